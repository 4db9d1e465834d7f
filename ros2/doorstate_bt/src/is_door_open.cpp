// SPDX-License-Identifier: Apache-2.0
#include "doorstate_bt/is_door_open.hpp"

namespace doorstate_bt {

using doorstate_msgs::msg::Door;
using doorstate_msgs::msg::Doors;

IsDoorOpen::IsDoorOpen(const std::string & name, const BT::NodeConfiguration & configuration)
: BT::ConditionNode(name, configuration) {}

BT::PortsList IsDoorOpen::providedPorts()
{
  return {
    BT::InputPort<std::string>("door", "", "Id in the list of doors; empty: the door most in front"),
    BT::InputPort<std::string>("topic", "/doorstate/door_list", "Topic of the doors"),
    BT::InputPort<double>("min_probability", 0.8, "Least probability of open"),
    BT::InputPort<double>("min_passable_width_m", 0.0, "Least passable width; 0: any"),
    BT::InputPort<bool>("require_leaf", true, "An open door without a visible leaf, which may be glass, does not count"),
    BT::InputPort<double>("expire_s", 2.0, "Time after which a state counts no more")};
}

BT::NodeStatus IsDoorOpen::tick()
{
  if (!subscription_) {
    subscribe(getInput<std::string>("topic").value());
  }
  executor_.spin_some();
  const std::chrono::duration<double> age = std::chrono::steady_clock::now() - received_;
  if (!has_doors_ || age.count() >= getInput<double>("expire_s").value()) {
    return BT::NodeStatus::FAILURE;
  }
  const auto door = find(getInput<std::string>("door").value_or(""));
  if (!door || !door->seen) {
    return BT::NodeStatus::FAILURE;
  }
  const auto state = door->id.empty() ? door->state : door->filtered_state;
  const bool is_unsure = door->probability < getInput<double>("min_probability").value();  // false for NaN: a rule
  const bool is_glass = getInput<bool>("require_leaf").value() && !door->leaf_seen;
  const double least_m = getInput<double>("min_passable_width_m").value();
  const bool is_narrow = least_m > 0.0 && !(door->passable_width_m >= least_m);
  const bool is_open = state == Door::OPEN && !is_unsure && !is_glass && !is_narrow;
  return is_open ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
}

void IsDoorOpen::subscribe(const std::string & topic)
{
  // The node of the tree does not spin while it ticks: these messages have a group and an executor of their own.
  const auto node = config().blackboard->get<rclcpp::Node::SharedPtr>("node");
  group_ = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false);
  executor_.add_callback_group(group_, node->get_node_base_interface());
  rclcpp::SubscriptionOptions options;
  options.callback_group = group_;
  subscription_ = node->create_subscription<Doors>(
    topic, rclcpp::QoS(1).reliable().transient_local(),
    [this](const Doors & doors) {
      doors_ = doors;
      received_ = std::chrono::steady_clock::now();
      has_doors_ = true;
    },
    options);
}

std::optional<Door> IsDoorOpen::find(const std::string & id) const
{
  for (const auto & door : doors_.doors) {
    if (id.empty() ? door.seen : door.id == id) {
      return door;
    }
  }
  return std::nullopt;
}

}  // namespace doorstate_bt

#include "behaviortree_cpp/bt_factory.h"
BT_REGISTER_NODES(factory)
{
  factory.registerNodeType<doorstate_bt::IsDoorOpen>("IsDoorOpen");
}
