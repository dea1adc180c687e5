# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Assembly of whole robot states from joint states and odometry; an unusable message is refused by name. No ROS."""
