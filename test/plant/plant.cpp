// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// A rigid arm as hardware of ros2_control, with dynamics of its own: recursive Newton-Euler.
// Without a controller its brakes hold it. Parameter q: positions at the start.

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include "hardware_interface/system_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "std_msgs/msg/float64_multi_array.hpp"
#include "urdf/model.h"

namespace dd_plant
{
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using hardware_interface::return_type;
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

constexpr double GRAVITY = 9.81;      // [m/s^2]
constexpr double MAX_STEP = 0.00026;  // of the integration [s]
constexpr double MAX_PERIOD = 0.02;   // of a cycle [s]
constexpr double MAX_SPEED = 3.2;     // under position commands [rad/s]
constexpr int PUSH_CYCLES = 30;       // that an external torque lasts

struct Body
{
  int parent = -1, dof = -1;
  Matrix3d rotation = Matrix3d::Identity(), inertia = Matrix3d::Zero();
  Vector3d origin = Vector3d::Zero(), axis = Vector3d::Zero(), center = Vector3d::Zero();
  double mass = 0.0;
};

Vector3d vector(const urdf::Vector3 & v) { return {v.x, v.y, v.z}; }

Matrix3d matrix(const urdf::Rotation & r)
{
  return Eigen::Quaterniond(r.w, r.x, r.y, r.z).toRotationMatrix();
}

bool ends_with(const std::string & text, const std::string & end)
{
  return text.size() > end.size() && !text.compare(text.size() - end.size(), end.size(), end);
}

class Plant : public hardware_interface::SystemInterface
{
public:
  CallbackReturn on_init(const hardware_interface::HardwareComponentInterfaceParams & params) override
  {
    urdf::Model model;
    if (SystemInterface::on_init(params) != CallbackReturn::SUCCESS ||
        !model.initString(info_.original_xml))
      return CallbackReturn::ERROR;
    for (auto & joint : info_.joints) names_.push_back(joint.name);
    add(model.getRoot(), -1);
    q_ = qd_ = effort_ = external_ = received_ = VectorXd::Zero(names_.size());
    std::istringstream start(info_.hardware_parameters["q"]);
    for (auto & position : q_) start >> position;
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    subscription_ = get_node()->create_subscription<std_msgs::msg::Float64MultiArray>(
      "/plant/external_torque", 10, [this](const std_msgs::msg::Float64MultiArray & message) {
        std::lock_guard<std::mutex> lock(mutex_);
        for (size_t i = 0; i < names_.size() && i < message.data.size(); i++)
          received_[i] = message.data[i];
        pushes_ = PUSH_CYCLES;
      });
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    effort_ = inverse_dynamics(q_, qd_, zero(), GRAVITY);
    publish();
    return CallbackReturn::SUCCESS;
  }

  return_type perform_command_mode_switch(
    const std::vector<std::string> & start, const std::vector<std::string> & stop) override
  {
    for (auto & name : stop)
      if (ends_with(name, mode_ == EFFORT ? "/effort" : "/position")) mode_ = BRAKES;
    for (auto & name : start) mode_ = ends_with(name, "/effort") ? EFFORT : POSITION;
    if (mode_ == POSITION)
      for (size_t i = 0; i < names_.size(); i++) set_command(names_[i] + "/position", q_[i]);
    return return_type::OK;
  }

  return_type read(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    publish();
    return return_type::OK;
  }

  return_type write(const rclcpp::Time &, const rclcpp::Duration & period) override
  {
    const double dt = std::min(period.seconds(), MAX_PERIOD);
    if (dt <= 0.0) return return_type::OK;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      external_ = pushes_ > 0 ? received_ : zero();
      pushes_ = std::max(0, pushes_ - 1);
    }
    VectorXd acceleration = zero();
    if (mode_ == EFFORT) {
      effort_ = commands("/effort", zero());  // none is 0
      const int steps = std::max(1, static_cast<int>(dt / MAX_STEP));
      for (int k = 0; k < steps; k++) {
        const VectorXd force = effort_ + external_ - inverse_dynamics(q_, qd_, zero(), GRAVITY);
        qd_ += dt / steps * mass_matrix().ldlt().solve(force);
        q_ += dt / steps * qd_;
      }
      return return_type::OK;
    }
    VectorXd velocity = zero();
    if (mode_ == POSITION)
      velocity = ((commands("/position", q_) - q_) / dt).cwiseMax(-MAX_SPEED).cwiseMin(MAX_SPEED);
    if (mode_ == POSITION) acceleration = (velocity - qd_) / dt;
    qd_ = velocity;
    q_ += dt * qd_;
    effort_ = inverse_dynamics(q_, qd_, acceleration, GRAVITY) - external_;
    return return_type::OK;
  }

private:
  enum { BRAKES, POSITION, EFFORT } mode_ = BRAKES;
  std::vector<Body> bodies_;
  std::vector<std::string> names_;
  VectorXd q_, qd_, effort_, external_, received_;
  int pushes_ = 0;  // cycles left of the external torque
  std::mutex mutex_;  // of received_ and pushes_
  rclcpp::Subscription<std_msgs::msg::Float64MultiArray>::SharedPtr subscription_;

  VectorXd zero() const { return VectorXd::Zero(names_.size()); }

  VectorXd commands(const std::string & interface, const VectorXd & instead)
  {
    VectorXd values = instead;
    for (size_t i = 0; i < names_.size(); i++) {
      const double command = get_command(names_[i] + interface);
      if (std::isfinite(command)) values[i] = command;
    }
    return values;
  }

  void publish()
  {
    for (size_t i = 0; i < names_.size(); i++) {
      set_state(names_[i] + "/position", q_[i]);
      set_state(names_[i] + "/velocity", qd_[i]);
      set_state(names_[i] + "/effort", effort_[i]);
    }
  }

  void add(const urdf::LinkConstSharedPtr & link, int parent)
  {
    Body body;
    body.parent = parent;
    if (auto joint = link->parent_joint) {
      const auto & placement = joint->parent_to_joint_origin_transform;
      body.rotation = matrix(placement.rotation);
      body.origin = vector(placement.position);
      if (joint->type == urdf::Joint::REVOLUTE || joint->type == urdf::Joint::CONTINUOUS) {
        body.axis = vector(joint->axis).normalized();
        body.dof = std::find(names_.begin(), names_.end(), joint->name) - names_.begin();
      }
    }
    if (auto inertial = link->inertial) {
      const Matrix3d axes = matrix(inertial->origin.rotation);
      Matrix3d inertia;
      inertia << inertial->ixx, inertial->ixy, inertial->ixz, inertial->ixy, inertial->iyy,
        inertial->iyz, inertial->ixz, inertial->iyz, inertial->izz;
      body.mass = inertial->mass;
      body.center = vector(inertial->origin.position);
      body.inertia = axes * inertia * axes.transpose();
    }
    bodies_.push_back(body);
    const int index = bodies_.size() - 1;
    for (auto & child : link->child_links) add(child, index);
  }

  VectorXd inverse_dynamics(
    const VectorXd & q, const VectorXd & qd, const VectorXd & qdd, double gravity) const
  {
    const size_t count = bodies_.size();
    std::vector<Matrix3d> axes(count);
    std::vector<Vector3d> spin(count), spin_rate(count), acceleration(count);
    std::vector<Vector3d> force(count), moment(count);
    for (size_t i = 0; i < count; i++) {
      const Body & b = bodies_[i];
      const bool moves = b.dof >= 0, root = b.parent < 0;
      const Vector3d velocity = moves ? Vector3d(b.axis * qd[b.dof]) : Vector3d::Zero();
      const Vector3d drive = moves ? Vector3d(b.axis * qdd[b.dof]) : Vector3d::Zero();
      axes[i] = b.rotation;
      if (moves) axes[i] = b.rotation * Eigen::AngleAxisd(q[b.dof], b.axis).toRotationMatrix();
      const Vector3d w = root ? Vector3d::Zero() : spin[b.parent];
      const Vector3d dw = root ? Vector3d::Zero() : spin_rate[b.parent];
      const Vector3d a = root ? Vector3d(0.0, 0.0, gravity) : acceleration[b.parent];
      const Matrix3d inward = axes[i].transpose();
      const Vector3d turned = inward * w;
      spin[i] = turned + velocity;
      spin_rate[i] = inward * dw + drive + turned.cross(velocity);
      acceleration[i] = inward * (a + dw.cross(b.origin) + w.cross(w.cross(b.origin)));
      const Vector3d curve = spin[i].cross(spin[i].cross(b.center));
      force[i] = b.mass * (acceleration[i] + spin_rate[i].cross(b.center) + curve);
      moment[i] = b.inertia * spin_rate[i] + spin[i].cross(b.inertia * spin[i]) +
                  b.center.cross(force[i]);
    }
    VectorXd torque = zero();
    for (size_t i = count; i-- > 0;) {
      const Body & b = bodies_[i];
      if (b.dof >= 0) torque[b.dof] = b.axis.dot(moment[i]);
      if (b.parent < 0) continue;
      const Vector3d outward = axes[i] * force[i];
      force[b.parent] += outward;
      moment[b.parent] += axes[i] * moment[i] + b.origin.cross(outward);
    }
    return torque;
  }

  MatrixXd mass_matrix() const
  {
    const int size = names_.size();
    MatrixXd columns(size, size);
    for (int k = 0; k < size; k++)
      columns.col(k) = inverse_dynamics(q_, zero(), VectorXd::Unit(size, k), 0.0);
    return columns;
  }
};
}  // namespace dd_plant

PLUGINLIB_EXPORT_CLASS(dd_plant::Plant, hardware_interface::SystemInterface)
