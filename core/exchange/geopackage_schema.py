# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and triggers that every GeoPackage has (OGC 12-128r19, annexes C and F.3), and QGIS's table of styles."""

WGS_84 = 4326
_WGS_84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
    'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],'
    'UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]'
)
SYSTEMS = (
    ("Undefined Cartesian SRS", -1, "NONE", -1, "undefined", "undefined Cartesian coordinate reference system"),
    ("Undefined geographic SRS", 0, "NONE", 0, "undefined", "undefined geographic coordinate reference system"),
    ("WGS 84 geodetic", WGS_84, "EPSG", WGS_84, _WGS_84, "longitude and latitude in degrees on the WGS 84 ellipsoid"),
)
"""Rows that have to be there."""

LAYER_STYLES = (
    """CREATE TABLE layer_styles (
        id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
        f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
        useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30), update_time DATETIME)""",
    """INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName, styleQML,
        styleSLD, useAsDefault, description, owner, ui, update_time)
        VALUES ('', '', ?, 'geom', ?, ?, '', 1, ?, '', NULL, ?)""",
)
SCHEMA = (
    """CREATE TABLE gpkg_spatial_ref_sys (
        srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL,
        organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT)""",
    """CREATE TABLE gpkg_contents (
        table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
        description TEXT DEFAULT '',
        last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
        min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
        CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id))""",
    """CREATE TABLE gpkg_geometry_columns (
        table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL,
        z TINYINT NOT NULL, m TINYINT NOT NULL,
        CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
        CONSTRAINT uk_gc_table_name UNIQUE (table_name),
        CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
        CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id))""",
    """CREATE TABLE gpkg_extensions (
        table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL, scope TEXT NOT NULL,
        CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name))""",
    LAYER_STYLES[0],
)

_BOX = "ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)"
_NEW = "(NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom))"
_OLD = "(OLD.geom NOTNULL AND NOT ST_IsEmpty(OLD.geom))"
_NO_NEW, _NO_OLD = "(NEW.geom ISNULL OR ST_IsEmpty(NEW.geom))", "(OLD.geom ISNULL OR ST_IsEmpty(OLD.geom))"
_R = '"rtree_{t}_geom"'
RTREE = (
    f"""CREATE TRIGGER "rtree_{{t}}_geom_insert" AFTER INSERT ON "{{t}}" WHEN {_NEW}
        BEGIN INSERT OR REPLACE INTO {_R} VALUES (NEW.fid, {_BOX}); END""",
    f"""CREATE TRIGGER "rtree_{{t}}_geom_update2" AFTER UPDATE OF geom ON "{{t}}" WHEN OLD.fid = NEW.fid AND {_NO_NEW}
        BEGIN DELETE FROM {_R} WHERE id = OLD.fid; END""",
    f"""CREATE TRIGGER "rtree_{{t}}_geom_update4" AFTER UPDATE ON "{{t}}" WHEN OLD.fid != NEW.fid AND {_NEW}
        BEGIN DELETE FROM {_R} WHERE id = OLD.fid; INSERT OR REPLACE INTO {_R} VALUES (NEW.fid, {_BOX}); END""",
    f"""CREATE TRIGGER "rtree_{{t}}_geom_update5" AFTER UPDATE ON "{{t}}" WHEN OLD.fid != NEW.fid AND {_NO_NEW}
        BEGIN DELETE FROM {_R} WHERE id IN (OLD.fid, NEW.fid); END""",
    f"""CREATE TRIGGER "rtree_{{t}}_geom_update6" AFTER UPDATE OF geom ON "{{t}}"
        WHEN OLD.fid = NEW.fid AND {_NEW} AND {_OLD}
        BEGIN UPDATE {_R} SET minx = ST_MinX(NEW.geom), maxx = ST_MaxX(NEW.geom), miny = ST_MinY(NEW.geom),
        maxy = ST_MaxY(NEW.geom) WHERE id = NEW.fid; END""",
    f"""CREATE TRIGGER "rtree_{{t}}_geom_update7" AFTER UPDATE OF geom ON "{{t}}"
        WHEN OLD.fid = NEW.fid AND {_NEW} AND {_NO_OLD}
        BEGIN INSERT INTO {_R} VALUES (NEW.fid, {_BOX}); END""",
    f"""CREATE TRIGGER "rtree_{{t}}_geom_delete" AFTER DELETE ON "{{t}}" WHEN OLD.geom NOT NULL
        BEGIN DELETE FROM {_R} WHERE id = OLD.fid; END""",
)
"""Keep the spatial index of a layer {t} when it is edited; the functions are those of the program that edits."""
