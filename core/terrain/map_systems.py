# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate reference systems by their definition, and coordinates from one into another, in plan.

Only what maps of a slope come in: degrees, Transverse Mercator (UTM and national grids), Lambert conformal conic, Web
Mercator, and the Swiss grids. All else is not known here, and must be transformed by a GIS. Formulas: IOGP Guidance
Note 7-2 (373-7-2, 2019), the Swiss ones: swisstopo, Formulas and constants (2016).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, radians

import numpy as np

from ..vectors import Array

SEMI_MAJOR_M, INVERSE_FLATTENING = 6378137.0, 298.257222101
GLOBAL = "global"
"""WGS 84 and the datums of continents that are within a metre or two of it: ETRS89, RGF93, NAD83."""
DATUMS: Mapping[str, tuple[float, ...]] = {
    GLOBAL: (0.0, 0.0, 0.0),
    "swiss": (674.374, 15.056, 405.346),  # EPSG:1676
    "mgi": (577.326, 90.129, 463.919, 5.137, 1.474, 5.297, 2.4232),  # EPSG:1618
}
"""Datum → to WGS 84: shifts [m], rotations of the position vector ["], scale [1e-6]."""
GLOBAL_NAMES = (
    "wgs", "worldgeodetic", "etrs", "europeanterrestrial", "rgf", "reseaugeodesiquefrancais", "nad83", "rgr92",
    "northamerican1983", "northamericandatum1983", "rdn2008", "retedinamicanazionale2008", "sloveniageodeticdatum",
    "slovenia1996", "newzealandgeodeticdatum2000", "nzgd2000", "reseaugeodesiquedelareunion1992", "sweref99",
)  # fmt: skip
DATUM_NAMES = {"ch1903": "swiss", "mgi": "mgi", "militargeographische": "mgi", "hermannskogel": "mgi"}
BESSEL = (6377397.155, 299.1528128)
ARC_SECOND = pi / 648000
METHODS = {
    "transversemercator": "tm", "gausskruger": "tm", "lambertconformalconic2sp": "lcc", "lambertconformalconic": "lcc",
    "lambertconicconformal2sp": "lcc", "lambertconformalconic1sp": "lcc1", "lambertconicconformal1sp": "lcc1",
    "swissobliquecylindrical": "swiss", "swissobliquemercator": "swiss", "mercatorauxiliarysphere": "web",
    "hotineobliquemercatorazimuthcenter": "hotine", "hotineobliquemercatorvariantb": "hotine",
    "popularvisualisationpseudomercator": "web",
}  # fmt: skip
NUMBER = r"([-\d.eE+]+)"
SAME_M, SAME_RAD = 1e-3, 1e-9


@dataclass(frozen=True)
class MapSystem:
    """A coordinate reference system, as far as plan coordinates need it.

    Attributes
    ----------
    method : geographic, tm (Transverse Mercator), lcc (Lambert conformal conic), swiss (oblique Mercator) or web.
    origin : longitude and latitude [rad] that the false coordinates are of.
    false_m : easting and northing of the origin [m].
    scale : at the origin.
    parallels : standard parallels of lcc [rad].
    ellipsoid : semi-major axis [m] and inverse flattening.
    to_wgs84 : see `DATUMS`; None where it is not known.
    unit : of the coordinates: metres, or radians of degrees.
    """

    method: str
    origin: tuple[float, float] = (0.0, 0.0)
    false_m: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0
    parallels: tuple[float, float] = (0.0, 0.0)
    ellipsoid: tuple[float, float] = (SEMI_MAJOR_M, INVERSE_FLATTENING)
    to_wgs84: tuple[float, ...] | None = DATUMS[GLOBAL]
    unit: float = 1.0

    @property
    def geographic(self) -> bool:
        """Whether its coordinates are angles."""
        return self.method == "geographic"


WGS84 = MapSystem("geographic", ellipsoid=(SEMI_MAJOR_M, 298.257223563), unit=radians(1))


def same_system(a: MapSystem, b: MapSystem) -> bool:
    """Whether coordinates mean the same places in both, but for their unit."""

    def numbers(one: MapSystem) -> Array:
        return np.array([*one.origin, *one.parallels, one.scale, *one.ellipsoid[:1]])

    return (
        a.method == b.method
        and bool((np.abs(numbers(a) - numbers(b)) < SAME_RAD * (1 + np.abs(numbers(b)))).all())
        and bool((np.abs(np.subtract(a.false_m, b.false_m)) < SAME_M).all())
        and (a.to_wgs84 == b.to_wgs84 or a.to_wgs84 is None or b.to_wgs84 is None)
    )


def transformed(xy: Array, source: MapSystem, target: MapSystem) -> Array | None:
    """Coordinates (n, 2) of one system [metres or degrees] in another [metres or degrees].

    Returns
    -------
    (n, 2), NaN beyond where a projection is defined; None where the two datums cannot be related.
    """
    if source.to_wgs84 is None or target.to_wgs84 is None:
        return None
    lonlat = _to_geographic(np.asarray(xy, dtype=np.float64), source)
    if source.to_wgs84 != target.to_wgs84:
        placed = _geocentric(lonlat, source.ellipsoid) @ _turn(source.to_wgs84).T + source.to_wgs84[:3]
        back = np.linalg.solve(_turn(target.to_wgs84), (placed - target.to_wgs84[:3]).T).T
        lonlat = _lonlat(np.asarray(back, dtype=np.float64), target.ellipsoid)
    return _from_geographic(lonlat, target)


def system_of(crs: str) -> MapSystem | None:
    """The system of a code, "EPSG:2056", or of a name as terrains state it; None for one that is not known here."""
    code = re.fullmatch(r"\s*EPSG\s*:\s*(\d+)\s*", crs, re.IGNORECASE)
    if code:
        return _of_code(int(code[1]))
    name = _plain(crs)
    zone = re.fullmatch(r"(wgs(?:19)?84|etrs(?:19)?89|nad(?:19)?83)utmzone(\d{1,2})(n|s)", name)
    if zone:
        return _utm(int(zone[2]), zone[3] == "s")
    for words, number in (
        ("ch1903lv95", 2056), ("ch1903lv03", 21781), ("rgf93lambert93", 2154), ("rgf1993lambert93", 2154),
        ("rgf93v1lambert93", 2154), ("wgs84pseudomercator", 3857), ("wgs1984webmercatorauxiliarysphere", 3857),
        ("wgs84", 4326), ("gcswgs1984", 4326),
    ):  # fmt: skip
        if name == words:
            return _of_code(number)
    return None


def system_of_wkt(text: str) -> MapSystem | None:
    """The system of a well-known text of the first kind (``.prj``); None for one that is not known here."""
    text = re.sub(r"\s*([\[\](),])\s*", r"\1", text.strip().strip("\0\ufeff")).replace("(", "[").replace(")", "]")
    spheroid = re.search(r'(?:SPHEROID|ELLIPSOID)\["[^"]*",([-\d.eE+]+),([-\d.eE+]+)', text, re.IGNORECASE)
    datum = re.search(r'(?:DATUM|ENSEMBLE)\["([^"]*)"', text, re.IGNORECASE)
    meridian = re.search(r'PRIMEM\["[^"]*",([-\d.eE+]+)', text, re.IGNORECASE)
    if not spheroid or not datum or (meridian and abs(_number(meridian[1])) > 1e-9):
        return None
    angle = re.search(rf'[^A-Z](?:ANGLE)?UNIT\["[^"]*",{NUMBER}', text, re.IGNORECASE)
    first = _number(angle[1]) if angle else radians(1)
    stated = re.search(r"TOWGS84\[([^\]]*)\]", text, re.IGNORECASE)
    to_wgs84 = tuple(map(_number, stated[1].split(","))) if stated else _datum(datum[1])
    base = replace(WGS84, ellipsoid=(_number(spheroid[1]), _number(spheroid[2])), to_wgs84=to_wgs84, unit=first)
    if re.match(r'PROJC\w*\["[^"]*Pseudo-?Mercator', text, re.IGNORECASE):
        return _of_code(3857)
    method = re.search(r'(?:PROJECTION|METHOD)\["([^"]*)"', text, re.IGNORECASE)
    if not method:
        return base if re.match(r"GEOG|GEOD", text, re.IGNORECASE) else None
    found = re.findall(r'PARAMETER\["([^"]*)",([-\d.eE+]+)', text, re.IGNORECASE)
    unit = unit_of_wkt(text)
    return _projected(METHODS.get(_plain(method[1]), ""), {_plain(a): _number(b) for a, b in found}, base, unit)


def _projected(method: str, given: Mapping[str, float], base: MapSystem, unit: float) -> MapSystem | None:
    """A projection with the parameters of a text; angles in degrees, lengths in its unit."""

    def value(*names: str, default: float = 0.0) -> float:
        return next((given[name] for name in names if name in given), default)

    longitude = value("centralmeridian", "longitudeofcenter", "longitudeofnaturalorigin", "longitudeofprojectioncentre",
                      "longitudeoffalseorigin")  # fmt: skip
    latitude = value("latitudeoforigin", "latitudeofcenter", "latitudeofnaturalorigin", "latitudeofprojectioncentre",
                     "latitudeoffalseorigin")  # fmt: skip
    scale = value("scalefactor", "scalefactoratnaturalorigin", "scalefactoratprojectioncentre", default=1.0)
    if method == "hotine":
        angles = (
            value("azimuth", "azimuthatprojectioncentre", "azimuthofinitialline"),
            value("rectifiedgridangle", "anglefromrectifiedtoskewgrid", default=90.0),
        )
        if any(abs(angle - 90) > 1e-9 for angle in angles):
            return None
        method = "swiss"
    parallels = (
        value("standardparallel1", "latitudeof1ststandardparallel", default=latitude),
        value("standardparallel2", "latitudeof2ndstandardparallel", default=latitude),
    )
    if method == "lcc1":
        method, parallels = "lcc", (latitude, latitude)
    if method == "web":
        base = replace(base, ellipsoid=WGS84.ellipsoid)
    if not method or (method == "swiss" and scale != 1.0):
        return None
    return replace(
        base,
        method=method,
        origin=(radians(longitude), radians(latitude)),
        false_m=(
            unit * value("falseeasting", "eastingatfalseorigin", "eastingatprojectioncentre"),
            unit * value("falsenorthing", "northingatfalseorigin", "northingatprojectioncentre"),
        ),
        scale=scale,
        parallels=(radians(parallels[0]), radians(parallels[1])) if method == "lcc" else (0.0, 0.0),
        unit=unit,
    )


def unit_of_wkt(text: str) -> float:
    """Metres in the unit of a projected system: that of the whole, which stands behind the geographic one."""
    text = re.sub(r"\s*([\[\](),])\s*", r"\1", text).replace("(", "[").replace(")", "]")
    outside = text
    start = re.search(r"(?:BASE)?GEOG(?:CS|CRS)\[|BASEGEODCRS\[", text, re.IGNORECASE)
    if start:
        depth = 0
        for i in range(start.start(), len(text)):
            depth += (text[i] == "[") - (text[i] == "]")
            if depth == 0 and text[i] == "]":
                outside = text[i:]
                break
    flat = re.split("VERT_?CS|VERTCRS", outside)[0]
    found = re.search(rf'[^A-Z](?:LENGTH)?UNIT\["[^"]*",{NUMBER}', flat, re.IGNORECASE)
    return _number(found[1]) if found else 1.0


def vertical_unit_of_wkt(text: str) -> float | None:
    """Metres in the unit of the heights of a compound system; None where the text says nothing of them."""
    parts = re.split(r"VERT_?CS|VERTCRS", text, maxsplit=1, flags=re.IGNORECASE)
    found = re.search(r'UNIT\s*\[\s*"[^"]*"\s*,\s*([-\d.eE+]+)', parts[1], re.IGNORECASE) if len(parts) > 1 else None
    return _number(found[1]) if found else None


def name_of_wkt(text: str) -> str:
    """ "EPSG:2056" of a system that gives its code, else its name, else empty.

    A compound system is known by its horizontal part.
    """
    compound = re.match(r'\s*(?:COMPD_?CS|COMPOUNDCRS)\s*\[\s*"[^"]*"\s*,', text, re.IGNORECASE)
    text = text[compound.end() :] if compound else text
    depth = 0
    for i, letter in enumerate(text):
        depth += (letter == "[") - (letter == "]")
        if depth == 0 and letter == "]":
            text = text[: i + 1]
            break
    code = re.search(r'(?:AUTHORITY|ID)\s*\[\s*"EPSG"\s*,\s*"?(\d+)"?\s*\]\s*\]\s*$', text, re.IGNORECASE)
    name = re.match(r'\s*\w+\s*\[\s*"([^"]*)"', text)
    return f"EPSG:{code[1]}" if code else name[1] if name else ""


def _number(text: str | float) -> float:
    """A number of a text; NaN for none, so that nothing is the same as it."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _plain(text: str) -> str:
    return re.sub("[^a-z0-9]", "", text.lower())


def _datum(name: str) -> tuple[float, ...] | None:
    plain = _plain(name).removeprefix("d")
    for words in GLOBAL_NAMES:
        if plain.startswith((words, f"d{words}")):
            return DATUMS[GLOBAL]
    for words, datum in DATUM_NAMES.items():
        if plain.startswith(words):
            return DATUMS[datum]
    return None


CSRS_ZONES = {
    2955: 11, 2956: 12, 2957: 13, 2958: 17, 2959: 18, 2960: 19, 2961: 20, 2962: 21, 3154: 7, 3155: 8, 3156: 9, 3157: 10,
    3158: 14, 3159: 15, 3160: 16,
}  # fmt: skip
UTM_CODES = {
    **{32600 + zone: zone for zone in range(1, 61)}, **{32700 + zone: -zone for zone in range(1, 61)},
    **{25800 + zone: zone for zone in range(28, 39)}, **{26900 + zone: zone for zone in range(1, 24)}, **CSRS_ZONES,
    3006: 33, 3067: 35, 6707: 32, 6708: 33, 6709: 34, 7791: 32, 7792: 33, 7793: 34, 2975: -40, 2972: 22, 5490: 20,
}  # fmt: skip
"""EPSG code → zone, of the south with a minus."""


def _utm(zone: int, south: bool) -> MapSystem:
    return _tm(6 * zone - 183, 5e5, 1e7 if south else 0.0, 0.9996)


def _tm(longitude: float, easting: float, northing: float, scale: float) -> MapSystem:
    return MapSystem("tm", (radians(longitude), 0.0), (easting, northing), scale)


def _conic(origin: tuple[float, float], false_m: tuple[float, float], parallels: tuple[float, float]) -> MapSystem:
    return MapSystem(
        "lcc", (radians(origin[0]), radians(origin[1])), false_m, 1.0, (radians(parallels[0]), radians(parallels[1]))
    )


def _of_code(code: int) -> MapSystem | None:
    """Of an EPSG code; 900913 is what web maps called their system before it had one."""
    swiss = MapSystem(
        "swiss", (radians(7 + 26 / 60 + 22.5 / 3600), radians(46 + 57 / 60 + 8.66 / 3600)), (2.6e6, 1.2e6),
        ellipsoid=BESSEL, to_wgs84=DATUMS["swiss"],
    )  # fmt: skip
    if code in (4326, 4979, 4258, 4171, 4269, 4937):
        return WGS84
    if code in UTM_CODES:
        return _utm(abs(UTM_CODES[code]), UTM_CODES[code] < 0)
    if code in (3857, 900913, 3785):
        return MapSystem("web", ellipsoid=WGS84.ellipsoid)
    if code in (2056, 21781):
        return swiss if code == 2056 else replace(swiss, false_m=(6e5, 2e5))
    if code == 2154:
        return _conic((3.0, 46.5), (7e5, 6.6e6), (49.0, 44.0))
    if 3942 <= code <= 3950:
        degrees = code - 3900
        return _conic((3.0, degrees), (1.7e6, (degrees - 41) * 1e6 + 2e5), (degrees - 0.75, degrees + 0.75))
    if code in (3416, 31287):
        lambert = _conic((13 + 1 / 3, 47.5), (4e5, 4e5), (49.0, 46.0))
        return lambert if code == 3416 else replace(lambert, ellipsoid=BESSEL, to_wgs84=DATUMS["mgi"])
    if 31254 <= code <= 31259:
        place = (code - 31254) % 3
        easting = 1.5e5 + 3e5 * place if code >= 31257 else 0.0
        return replace(_tm(10 + 1 / 3 + 3 * place, easting, -5e6, 1.0), ellipsoid=BESSEL, to_wgs84=DATUMS["mgi"])
    if code == 3794:
        return _tm(15.0, 5e5, -5e6, 0.9999)
    if code == 2193:
        return _tm(173.0, 1.6e6, 1e7, 0.9996)
    return None


def _shape_of(ellipsoid: tuple[float, float]) -> tuple[float, float, float]:
    """Semi-major axis, first eccentricity, third flattening."""
    a, inverse = ellipsoid
    f = 1 / inverse if inverse else 0.0
    return a, float(np.sqrt(f * (2 - f))), f / (2 - f)


def _to_geographic(xy: Array, system: MapSystem) -> Array:
    """(n, 2) longitude and latitude [rad]."""
    if system.geographic:
        return xy * system.unit
    a, e, n = _shape_of(system.ellipsoid)
    x, y = ((xy - system.false_m) / (a * system.scale)).T
    longitude, latitude = system.origin
    with np.errstate(all="ignore"):
        match system.method:
            case "web":
                return np.column_stack([longitude + x, pi / 2 - 2 * np.arctan(np.exp(-y))])
            case "tm":
                return _tm_inverse(x, y, system, e, n)
            case "lcc":
                power, factor, radius = _cone(system, e)
                rho = np.sign(power) * np.hypot(x, radius - y)
                theta = np.arctan2(np.sign(power) * x, np.sign(power) * (radius - y))
                isometric = -np.log((rho / factor) ** (1 / power))
                return np.column_stack([longitude + theta / power, _latitude(isometric, e)])
            case _:
                alpha, b0, shift, radius = _swiss(latitude, e)
                turned, b = x / radius, 2 * (np.arctan(np.exp(y / radius)) - pi / 4)
                lat = np.arcsin(np.cos(b0) * np.sin(b) + np.sin(b0) * np.cos(b) * np.cos(turned))
                lon = np.arctan2(np.sin(turned), np.cos(b0) * np.cos(turned) - np.sin(b0) * np.tan(b))
                isometric = (np.arctanh(np.sin(lat)) - shift) / alpha
                return np.column_stack([longitude + lon / alpha, _latitude(isometric, e)])


def _from_geographic(lonlat: Array, system: MapSystem) -> Array:
    """(n, 2) coordinates [m, or the unit of a geographic system]."""
    if system.geographic:
        return lonlat / system.unit
    a, e, n = _shape_of(system.ellipsoid)
    longitude, latitude = system.origin
    away = np.remainder(lonlat[:, 0] - longitude + pi, 2 * pi) - pi
    with np.errstate(all="ignore"):
        match system.method:
            case "web":
                plane = np.column_stack([away, np.arctanh(np.sin(lonlat[:, 1]))])
            case "tm":
                plane = _tm_forward(away, lonlat[:, 1], system, e, n)
            case "lcc":
                power, factor, radius = _cone(system, e)
                rho = factor * np.exp(-power * _isometric(lonlat[:, 1], e))
                plane = np.column_stack([rho * np.sin(power * away), radius - rho * np.cos(power * away)])
            case _:
                alpha, b0, shift, radius = _swiss(latitude, e)
                b, turn = np.arcsin(np.tanh(alpha * _isometric(lonlat[:, 1], e) + shift)), alpha * away
                lon = np.arctan2(np.sin(turn), np.sin(b0) * np.tan(b) + np.cos(b0) * np.cos(turn))
                lat = np.arcsin(np.cos(b0) * np.sin(b) - np.sin(b0) * np.cos(b) * np.cos(turn))
                plane = radius * np.column_stack([lon, np.arctanh(np.sin(lat))])
    return plane * a * system.scale + system.false_m


def _isometric(latitude: Array, e: float) -> Array:
    sine = np.sin(latitude)
    return np.arctanh(sine) - e * np.arctanh(e * sine)


def _latitude(isometric: Array, e: float) -> Array:
    """The latitude of an isometric one, to rounding."""
    latitude = np.arcsin(np.tanh(isometric))
    for _ in range(12):
        latitude = np.arcsin(np.tanh(isometric + e * np.arctanh(e * np.sin(latitude))))
    return latitude


def _cone(system: MapSystem, e: float) -> tuple[float, float, float]:
    """Exponent, factor, and radius at the origin of a conic with a semi-major axis of one."""

    def both(latitude: float) -> tuple[float, float]:
        sine = np.sin(latitude)
        return float(np.cos(latitude) / np.sqrt(1 - (e * sine) ** 2)), float(_isometric(np.array(latitude), e))

    (m1, q1), (m2, q2) = both(system.parallels[0]), both(system.parallels[1])
    power = float(np.sin(system.parallels[0])) if abs(q1 - q2) < 1e-12 else float(np.log(m1 / m2) / (q2 - q1))
    factor = m1 * float(np.exp(power * q1)) / power
    return power, factor, factor * float(np.exp(-power * _isometric(np.array(system.origin[1]), e)))


def _swiss(latitude: float, e: float) -> tuple[float, float, float, float]:
    """α, b0, K and the radius of the sphere, of a semi-major axis of one."""
    sine, cosine = np.sin(latitude), np.cos(latitude)
    alpha = float(np.sqrt(1 + e**2 / (1 - e**2) * cosine**4))
    b0 = float(np.arcsin(sine / alpha))
    shift = float(np.arctanh(np.sin(b0)) - alpha * _isometric(np.array(latitude), e))
    return alpha, b0, shift, float(np.sqrt(1 - e**2) / (1 - (e * sine) ** 2))


def _series(n: float) -> tuple[float, Array, Array]:
    """Radius of the rectifying circle, and the coefficients forward and back, of a semi-major axis of one."""
    radius = (1 + n**2 / 4 + n**4 / 64) / (1 + n)
    forward = (
        n / 2 - 2 / 3 * n**2 + 5 / 16 * n**3 + 41 / 180 * n**4,
        13 / 48 * n**2 - 3 / 5 * n**3 + 557 / 1440 * n**4,
        61 / 240 * n**3 - 103 / 140 * n**4,
        49561 / 161280 * n**4,
    )
    back = (
        n / 2 - 2 / 3 * n**2 + 37 / 96 * n**3 - 1 / 360 * n**4,
        1 / 48 * n**2 + 1 / 15 * n**3 - 437 / 1440 * n**4,
        17 / 480 * n**3 - 37 / 840 * n**4,
        4397 / 161280 * n**4,
    )
    return radius, np.array(forward), np.array(back)


def _meridian(latitude: float, e: float, n: float) -> float:
    """Distance along a meridian from the equator, of a semi-major axis of one."""
    radius, forward, _ = _series(n)
    sphere = float(np.arcsin(np.tanh(_isometric(np.array(latitude), e))))
    return radius * (sphere + float(forward @ np.sin(2 * np.arange(1, 5) * sphere)))


def _tm_forward(away: Array, latitude: Array, system: MapSystem, e: float, n: float) -> Array:
    radius, forward, _ = _series(n)
    isometric = _isometric(latitude, e)
    eta = np.arctanh(np.sin(away) / np.cosh(isometric))
    xi = np.arctan2(np.sinh(isometric), np.cos(away))
    twice = 2 * np.arange(1, 5)[:, None]
    up = xi + forward @ (np.sin(twice * xi) * np.cosh(twice * eta))
    east = eta + forward @ (np.cos(twice * xi) * np.sinh(twice * eta))
    return np.column_stack([radius * east, radius * up - _meridian(system.origin[1], e, n)])


def _tm_inverse(x: Array, y: Array, system: MapSystem, e: float, n: float) -> Array:
    radius, _, back = _series(n)
    xi, eta = (y + _meridian(system.origin[1], e, n)) / radius, x / radius
    twice = 2 * np.arange(1, 5)[:, None]
    up = xi - back @ (np.sin(twice * xi) * np.cosh(twice * eta))
    east = eta - back @ (np.cos(twice * xi) * np.sinh(twice * eta))
    isometric = np.arctanh(np.sin(up) / np.cosh(east))
    return np.column_stack([system.origin[0] + np.arctan2(np.sinh(east), np.cos(up)), _latitude(isometric, e)])


def _geocentric(lonlat: Array, ellipsoid: tuple[float, float]) -> Array:
    """(n, 3) of places on the ellipsoid."""
    a, e, _ = _shape_of(ellipsoid)
    lon, lat = lonlat.T
    radius = a / np.sqrt(1 - (e * np.sin(lat)) ** 2)
    return np.column_stack(
        [radius * np.cos(lat) * np.cos(lon), radius * np.cos(lat) * np.sin(lon), radius * (1 - e**2) * np.sin(lat)]
    )


def _lonlat(places: Array, ellipsoid: tuple[float, float]) -> Array:
    """(n, 2) under places near the ellipsoid."""
    a, e, _ = _shape_of(ellipsoid)
    across = np.hypot(places[:, 0], places[:, 1])
    latitude = np.arctan2(places[:, 2], across * (1 - e**2))
    for _ in range(8):
        sine = np.sin(latitude)
        latitude = np.arctan2(places[:, 2] + e**2 * a * sine / np.sqrt(1 - (e * sine) ** 2), across)
    return np.column_stack([np.arctan2(places[:, 1], places[:, 0]), latitude])


def _turn(to_wgs84: tuple[float, ...]) -> Array:
    """(3, 3) rotation and scale of the position vector, of small angles."""
    rx, ry, rz, scale = (*to_wgs84[3:], 0.0, 0.0, 0.0, 0.0)[:4]
    rx, ry, rz = rx * ARC_SECOND, ry * ARC_SECOND, rz * ARC_SECOND
    return (1 + scale * 1e-6) * np.array([[1, -rz, ry], [rz, 1, -rx], [-ry, rx, 1]])
