# SPDX-License-Identifier: GPL-3.0-or-later
"""What must be on the machine: the Python packages, and the system libraries that Blender as a module links to.

Only the standard library is imported here, so that the set-up script and the extension can ask before anything else
is installed.
"""

import ctypes
import importlib.util
import os
import shutil
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from .errors import DependencyError

PACKAGES = (
    "numpy", "scipy", "trimesh", "numba", "llvmlite", "laspy", "lazrs", "startinpy", "mapbox_earcut", "shapefile",
    "tifffile", "tomli_w", "cv2",
)  # fmt: skip
"""Import names of the Python packages that Rockfall needs; all but NumPy travel in the extension as wheels."""
DISTRIBUTIONS = {"cv2": "opencv_python_headless", "shapefile": "pyshp"}
"""Under which name a package is to be had, where it is another than that for importing."""


@dataclass(frozen=True)
class SystemLibrary:
    """A shared library on Linux, and the packages that bring it, by package manager."""

    file: str
    apt: str
    dnf: str
    pacman: str


BLENDER_LIBRARIES = (
    SystemLibrary("libX11.so.6", "libx11-6", "libX11", "libx11"),
    SystemLibrary("libXrender.so.1", "libxrender1", "libXrender", "libxrender"),
    SystemLibrary("libXfixes.so.3", "libxfixes3", "libXfixes", "libxfixes"),
    SystemLibrary("libXi.so.6", "libxi6", "libXi", "libxi"),
    SystemLibrary("libxkbcommon.so.0", "libxkbcommon0", "libxkbcommon", "libxkbcommon"),
    SystemLibrary("libSM.so.6", "libsm6", "libSM", "libsm"),
    SystemLibrary("libICE.so.6", "libice6", "libICE", "libice"),
    SystemLibrary("libGL.so.1", "libgl1", "libglvnd-glx", "libglvnd"),
)
"""What ``import bpy`` (the wheel of Blender 5.2) links to and does not bring along, checked in a bare Debian."""

GRAPHICS_LIBRARIES = (
    SystemLibrary("libEGL.so.1", "libegl1", "libglvnd-egl", "libglvnd"),
    SystemLibrary("libEGL_mesa.so.0", "libegl-mesa0", "mesa-libEGL", "mesa"),
)
"""What Workbench and EEVEE need besides on a machine without a graphics driver; Cycles does without."""

_INSTALL_COMMANDS = {
    "apt": ("apt-get", "apt-get install -y --no-install-recommends"),
    "dnf": ("dnf", "dnf install -y"),
    "pacman": ("pacman", "pacman -S --noconfirm"),
}


def missing_packages(names: Iterable[str] = PACKAGES) -> tuple[str, ...]:
    """Those of the Python packages that cannot be found; nothing is imported."""
    return tuple(name for name in names if importlib.util.find_spec(name) is None)


def missing_system_libraries(
    *, graphics: bool = False, load: Callable[[str], object] = ctypes.CDLL
) -> tuple[SystemLibrary, ...]:
    """The shared libraries that the dynamic loader does not find; always none on Windows and macOS.

    Parameters
    ----------
    graphics : also ask for what GPU rendering needs.
    load : the loader, which raises OSError for a library that is not there.
    """
    if not sys.platform.startswith("linux"):
        return ()

    def absent(library: SystemLibrary) -> bool:
        try:
            load(library.file)
        except OSError:
            return True
        return False

    wanted = (*BLENDER_LIBRARIES, *GRAPHICS_LIBRARIES) if graphics else BLENDER_LIBRARIES
    return tuple(library for library in wanted if absent(library))


def package_manager() -> str | None:
    """``apt``, ``dnf`` or ``pacman``, whichever this machine has."""
    return next((name for name, (program, _) in _INSTALL_COMMANDS.items() if shutil.which(program)), None)


def install_command(libraries: Iterable[SystemLibrary], manager: str) -> str:
    """The command line, without sudo, that installs the packages of the libraries."""
    packages = dict.fromkeys(getattr(library, manager) for library in libraries)
    return f"{_INSTALL_COMMANDS[manager][1]} {' '.join(packages)}"


def explain_missing_libraries(libraries: Iterable[SystemLibrary]) -> str:
    """Sentences for a person: what is missing and the command that installs it."""
    libraries = tuple(libraries)
    message = f"Blender needs system libraries that are not installed: {', '.join(each.file for each in libraries)}."
    manager = package_manager()
    if manager is None:
        packages = " ".join(dict.fromkeys(library.apt for library in libraries))
        return f"{message} Install them with your system's package manager (Debian calls them {packages})."
    sudo = "" if os.geteuid() == 0 else "sudo "
    return f"{message} Install them with: {sudo}{install_command(libraries, manager)}"


def require_blender_libraries() -> None:
    """To be called before ``import bpy``.

    Raises
    ------
    DependencyError
        when a library is missing that Blender as a Python module links to; the message names the package and the
        command that installs it.
    """
    missing = missing_system_libraries()
    if missing:
        raise DependencyError(explain_missing_libraries(missing))
