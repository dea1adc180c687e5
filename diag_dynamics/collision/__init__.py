# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collision: thresholds of external torque and their calibration, predicted contact and its limits.

All of it is advisory, not safety-rated. detector: thresholds, detector, alarms. calibration and
residuals: thresholds from recordings without contact. contact_points and link_geometry: points of
links, and limits of body regions. predicted_contact: contact at these points, and impacts.
"""
