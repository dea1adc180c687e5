# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact: points of links, predicted contact there, limits of body regions, impacts. Advisory, not safety-rated.

A wrong argument raises an InputError that names it, its value and what was expected.

points: points of links and body regions. geometry: points of shapes. impact: formulas of the
transient contact of two masses, and ν before and after an impact. results: the predicted contact.
Its kernels are in sweeps.
"""
