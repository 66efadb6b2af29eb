// An update loop in the form of a ros2_control controller: it reads the taxels of a hand from its
// state interfaces, and writes for each finger whether it slides or is unstable (1) or not (0).
//
//     holdfast export builtin:any model.h --like recording.parquet
//
// `update` allocates nothing, takes no lock and reads no file: all memory is in the member.
#include "model.h"

#include <string>

#include <controller_interface/controller_interface.hpp>

namespace holdfast_example
{
using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::interface_configuration_type;
using controller_interface::return_type;

class SlipController : public controller_interface::ControllerInterface
{
public:
  CallbackReturn on_init() override { return CallbackReturn::SUCCESS; }

  InterfaceConfiguration state_interface_configuration() const override
  {
    InterfaceConfiguration wanted{interface_configuration_type::INDIVIDUAL, {}};
    for (int i = 0; i < HOLDFAST_N_TAXELS; ++i) {
      for (const char * axis : {"/x", "/y", "/z"}) {
        wanted.names.push_back("taxel" + std::to_string(i) + axis);
      }
    }
    return wanted;
  }

  InterfaceConfiguration command_interface_configuration() const override
  {
    InterfaceConfiguration wanted{interface_configuration_type::INDIVIDUAL, {}};
    for (int f = 0; f < HOLDFAST_N_FINGERS; ++f) {
      wanted.names.push_back("finger" + std::to_string(f) + "/needs_force");
    }
    return wanted;
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    holdfast_init(&detector_);  // takes the tare again: the hand is open now
    return CallbackReturn::SUCCESS;
  }

  return_type update(const rclcpp::Time & time, const rclcpp::Duration &) override
  {
    for (int i = 0; i < HOLDFAST_N_TAXELS; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        readings_[i][axis] =
          static_cast<holdfast_real>(state_interfaces_[3 * i + axis].get_value());
      }
    }
    if (holdfast_update(&detector_, time.seconds(), readings_, &estimate_) != HOLDFAST_OK) {
      return return_type::OK;  // the same sample once more: nothing is new
    }
    for (int f = 0; f < HOLDFAST_N_FINGERS; ++f) {
      const holdfast_finger_estimate & finger = estimate_.finger[f];
      const bool slides = finger.cause == HOLDFAST_CAUSE_SLIP;
      const bool needs_force = slides || finger.state == HOLDFAST_UNSTABLE;
      command_interfaces_[f].set_value(needs_force ? 1.0 : 0.0);
    }
    return return_type::OK;
  }

private:
  holdfast_detector detector_;
  holdfast_estimate estimate_;
  holdfast_real readings_[HOLDFAST_N_TAXELS][3];
};
}  // namespace holdfast_example
