#!/usr/bin/env bash
# What a container runs: a command of diag-dynamics, with the workspace sourced. exec: signals reach the node itself.
set -e
source "/opt/ros/${ROS_DISTRO:?is set by the image}/setup.bash"
source /ws/install/setup.bash
exec diag-dynamics "$@"
