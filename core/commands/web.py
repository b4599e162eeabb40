# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall web``: a project → a page of its site and blocks in three dimensions, one file that needs no network."""

import argparse
from pathlib import Path

from .options import add_out, naming
from .progress import PrintedProgress
from .show_options import add_show_options, show_as_asked

NAME = "site.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_show_options(parser)
    add_out(parser)
    parser.add_argument(
        "--language",
        default="en",
        metavar="en|fr|de",
        help="in which the page begins (default %(default)s); whoever reads it can change it",
    )


def run(arguments: argparse.Namespace) -> int:
    """Make the page."""
    from ..output import output_folder, write_text
    from ..outreach.page import check_language, make_page
    from ..outreach.show import open_show

    check_language(arguments.language)
    request = show_as_asked(arguments)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        with naming(str(arguments.project)):
            show = open_show(request, progress)
        page = make_page(show, arguments.language, progress=progress)
        write_text(folder / NAME, page.text)
    for remark in show.remarks:
        print(remark)
    print(f"{page.blocks} blocks over {page.faces:,} triangles, {page.size_bytes / 1e6:.1f} MB, no network needed")
    print(f"Written: {Path(arguments.out) / NAME}")
    return 0
