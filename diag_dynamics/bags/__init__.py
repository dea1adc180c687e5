# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of messages, read and written in pieces: bytes and times, whatever they mean."""
