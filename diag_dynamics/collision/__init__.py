# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collision detection: thresholds, detector, alarms and calibration."""
