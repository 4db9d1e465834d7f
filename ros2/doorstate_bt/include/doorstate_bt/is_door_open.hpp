// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "behaviortree_cpp/condition_node.h"
#include "doorstate_msgs/msg/door.hpp"
#include "doorstate_msgs/msg/doors.hpp"
#include "rclcpp/rclcpp.hpp"

namespace doorstate_bt {

/// Condition that succeeds while a door is seen open. An old state, silence and a door that is not seen are no success.
class IsDoorOpen : public BT::ConditionNode {
public:
  IsDoorOpen(const std::string & name, const BT::NodeConfiguration & configuration);

  static BT::PortsList providedPorts();

  BT::NodeStatus tick() override;

private:
  void subscribe(const std::string & topic);
  std::optional<doorstate_msgs::msg::Door> find(const std::string & id) const;

  rclcpp::CallbackGroup::SharedPtr group_;
  rclcpp::executors::SingleThreadedExecutor executor_;
  rclcpp::Subscription<doorstate_msgs::msg::Doors>::SharedPtr subscription_;
  doorstate_msgs::msg::Doors doors_;
  std::chrono::steady_clock::time_point received_{};
  bool has_doors_ = false;
};

}  // namespace doorstate_bt
