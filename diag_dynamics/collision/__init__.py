# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collision detection: thresholds on external torque, the detector, its alarms, and their calibration."""
