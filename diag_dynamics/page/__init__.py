# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page: a robot as a scene, its states as frames, and the server that streams them. No ROS."""
