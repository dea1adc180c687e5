#!/usr/bin/env bash
# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# What a container runs: a command of diag-dynamics, with the workspace sourced. exec: signals reach the node itself.
set -e
# shellcheck source=/dev/null
source "/opt/ros/${ROS_DISTRO:?is set by the image}/setup.bash"
# shellcheck source=/dev/null
source /ws/install/setup.bash
exec diag-dynamics "$@"
