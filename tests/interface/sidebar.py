# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person sees first: the tab in the sidebar."""


def case_sidebar_shows_rockfall(window):
    """The enabled extension has its tab, and nothing is wrong with the installation."""
    assert window.part("rockfall_addon.preferences").problem == ""
    yield from window.show_sidebar("Rockfall")
    window.screenshot("tab")
    x, y = window.centre()
    yield from window.press("N", x, y)
    assert not window.area().spaces.active.show_region_ui, "N hides the sidebar"
