// Stand-in for the header of ros2_control, with what the example uses.
#pragma once

#include <string>
#include <vector>

namespace rclcpp
{
struct Time
{
  double value;
  double seconds() const { return value; }
};
struct Duration
{
};
}  // namespace rclcpp

namespace rclcpp_lifecycle
{
struct State
{
};
}  // namespace rclcpp_lifecycle

namespace controller_interface
{
enum class CallbackReturn { SUCCESS, FAILURE };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration
{
  interface_configuration_type type;
  std::vector<std::string> names;
};
struct Interface
{
  double value;
  double get_value() const { return value; }
  void set_value(double given) { value = given; }
};
class ControllerInterface
{
public:
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  std::vector<Interface> state_interfaces_, command_interfaces_;
};
}  // namespace controller_interface
