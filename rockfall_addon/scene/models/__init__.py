# SPDX-License-Identifier: GPL-3.0-or-later
"""Impact models beside the measured impacts, their parameters, and the graphs."""
