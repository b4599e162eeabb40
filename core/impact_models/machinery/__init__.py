# SPDX-License-Identifier: GPL-3.0-or-later
"""What all impact models are made of: parameters, chance, contact, compilation. A model is a file above this one."""
