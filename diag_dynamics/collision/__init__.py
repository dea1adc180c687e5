# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms on external torque: thresholds, the detector that judges by them, and how often it is wrong."""
