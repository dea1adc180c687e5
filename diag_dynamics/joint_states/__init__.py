# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rules of joint states: messages or rows of tables in, states of the whole robot and reasons of rejections out."""
