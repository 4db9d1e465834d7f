// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include "doorstate_msgs/action/wait_for_door.hpp"
#include "nav2_behavior_tree/bt_action_node.hpp"

namespace doorstate_bt {

using Action = doorstate_msgs::action::WaitForDoor;

/// Action that runs until a door has a state; it fails after its time-out.
class WaitForDoor : public nav2_behavior_tree::BtActionNode<Action> {
public:
  WaitForDoor(
    const std::string & xml_tag_name, const std::string & action_name, const BT::NodeConfiguration & configuration)
  : BtActionNode<Action>(xml_tag_name, action_name, configuration) {}

  static BT::PortsList providedPorts()
  {
    return providedBasicPorts(
      {BT::InputPort<std::string>("door", "", "Id in the list of doors; empty: the door most in front"),
       BT::InputPort<int>("state", 3, "Wanted: 1 closed, 2 semi-open, 3 open"),
       BT::InputPort<double>("timeout_s", 60.0, "0: wait for ever"),
       BT::InputPort<double>("hold_s", 1.0, "Time for which the state must have held"),
       BT::InputPort<double>("min_probability", 0.8, "Least probability of the state"),
       BT::InputPort<double>("min_passable_width_m", 0.0, "Least passable width; 0: any"),
       BT::InputPort<bool>("require_leaf", true, "An open door without a visible leaf does not count"),
       BT::OutputPort<std::string>("reason", "Why the state was not reached")});
  }

  void on_tick() override
  {
    int state = 3;
    getInput("door", goal_.door);
    getInput("state", state);
    goal_.state = static_cast<uint8_t>(state);
    getInput("timeout_s", goal_.timeout_s);
    getInput("hold_s", goal_.hold_s);
    getInput("min_probability", goal_.min_probability);
    getInput("min_passable_width_m", goal_.min_passable_width_m);
    getInput("require_leaf", goal_.require_leaf);
  }

  BT::NodeStatus on_aborted() override
  {
    setOutput("reason", result_.result->reason);
    return BT::NodeStatus::FAILURE;
  }
};

}  // namespace doorstate_bt

#include "behaviortree_cpp/bt_factory.h"
BT_REGISTER_NODES(factory)
{
  BT::NodeBuilder builder = [](const std::string & name, const BT::NodeConfiguration & configuration) {
    return std::make_unique<doorstate_bt::WaitForDoor>(name, "wait_for_door", configuration);
  };
  factory.registerBuilder<doorstate_bt::WaitForDoor>("WaitForDoor", builder);
}
