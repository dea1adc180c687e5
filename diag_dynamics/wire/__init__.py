# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as the bytes that DDS carries and bags keep: laid out, and joint states of them taken in. No ROS."""
