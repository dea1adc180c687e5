# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of joint states.

They turn messages or rows of tables into states of the whole robot and reasons of rejections.
"""
