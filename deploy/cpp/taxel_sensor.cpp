// A sensor of ros2_control (jazzy, kilted): the force on a patch of skin from the shared memory of taxeld, as state interfaces.
//
// Not compiled by the tests of taxeld, which cannot have these headers: it is written from those of ros2_control. Without a force
// every state is NaN, never an old value. read() makes no system call while the daemon lives, and never waits.
//
// Put this file and taxel_force.h into the src folder of a package made by
//     ros2 pkg create --build-type ament_cmake --library-name taxel_sensor
//         --dependencies hardware_interface pluginlib rclcpp_lifecycle -- taxel_sensor
// with `pluginlib_export_plugin_description_file(hardware_interface taxel_sensor.xml)` in its CMakeLists.txt, and this as taxel_sensor.xml:
//     <library path="taxel_sensor">
//       <class name="taxel/TaxelSensor" type="taxel::TaxelSensor" base_class_type="hardware_interface::SensorInterface"/>
//     </library>
//
// In the robot's description, any of these interfaces; force.x to torque.z need `outputs = ["resultant", "moment"]` in taxeld.toml:
//     <ros2_control name="left_forearm" type="sensor">
//       <hardware>
//         <plugin>taxel/TaxelSensor</plugin>
//         <param name="page">/run/taxeld/force/left_forearm</param>
//       </hardware>
//       <sensor name="left_forearm">
//         <state_interface name="force.x"/> <state_interface name="force.y"/> <state_interface name="force.z"/>
//         <state_interface name="torque.x"/> <state_interface name="torque.y"/> <state_interface name="torque.z"/>
//         <state_interface name="total"/> <state_interface name="low"/> <state_interface name="high"/>
//         <state_interface name="age"/> <state_interface name="simulated"/>
//       </sensor>
//     </ros2_control>
// force_torque_sensor_broadcaster with sensor_name: left_forearm publishes the first six as a wrench.

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "hardware_interface/sensor_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "taxel_force.h"

namespace taxel {

using hardware_interface::CallbackReturn;

class TaxelSensor : public hardware_interface::SensorInterface {
public:
    CallbackReturn on_init(const hardware_interface::HardwareInfo &info) override {
        if (SensorInterface::on_init(info) != CallbackReturn::SUCCESS) return CallbackReturn::ERROR;
        const auto page = info.hardware_parameters.find("page");
        if (page == info.hardware_parameters.end() || info.sensors.size() != 1) {
            RCLCPP_ERROR(get_logger(), "expected one sensor, and the parameter `page`, such as /run/taxeld/force/left_forearm");
            return CallbackReturn::ERROR;
        }
        if (taxel_force_init(&reader_, page->second.c_str()) != 0) return CallbackReturn::ERROR;
        for (const auto &interface : info.sensors[0].state_interfaces) {
            const auto figure = FIGURES.find(interface.name);
            if (figure == FIGURES.end()) {
                RCLCPP_ERROR(get_logger(), "there is no state `%s` of a skin", interface.name.c_str());
                return CallbackReturn::ERROR;
            }
            states_.emplace_back(info.sensors[0].name + "/" + interface.name, figure->second);
        }
        return CallbackReturn::SUCCESS;
    }

    hardware_interface::return_type read(const rclcpp::Time &, const rclcpp::Duration &) override {
        taxel_force force;
        const bool good = taxel_force_follow(&reader_, 0, &force) == TAXEL_FORCE_GOOD;
        for (const auto &[name, figure] : states_) set_state(name, good ? figure(force) : std::nan(""));
        return hardware_interface::return_type::OK;
    }

private:
    using Figure = double (*)(const taxel_force &);
    inline static const std::map<std::string, Figure> FIGURES = {
        {"force.x", [](const taxel_force &f) { return f.resultant_n[0]; }},
        {"force.y", [](const taxel_force &f) { return f.resultant_n[1]; }},
        {"force.z", [](const taxel_force &f) { return f.resultant_n[2]; }},
        {"torque.x", [](const taxel_force &f) { return f.moment_nm[0]; }},
        {"torque.y", [](const taxel_force &f) { return f.moment_nm[1]; }},
        {"torque.z", [](const taxel_force &f) { return f.moment_nm[2]; }},
        {"total", [](const taxel_force &f) { return f.total_n; }},
        {"low", [](const taxel_force &f) { return f.low_n; }},
        {"high", [](const taxel_force &f) { return f.high_n; }},
        {"age", [](const taxel_force &f) { return static_cast<double>(f.age_ns) * 1e-9; }},
        {"simulated", [](const taxel_force &f) { return static_cast<double>(f.simulated); }},
    };

    taxel_force_reader reader_{};
    std::vector<std::pair<std::string, Figure>> states_;
};

} // namespace taxel

PLUGINLIB_EXPORT_CLASS(taxel::TaxelSensor, hardware_interface::SensorInterface)
