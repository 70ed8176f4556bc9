"""A reading as files: the document, the map, the pictures."""

from __future__ import annotations

import csv
from pathlib import Path

from siloscope.reporting.renewal import without_older
from siloscope.schema import documents
from siloscope.types.content import Content
from siloscope.types.surface_map import KINDS, SurfaceMap

COLUMNS = ("x_m", "y_m", "height_m", "std_m", "kind")
"""Columns of the map's file; heights are over the reading's datum."""


RESULTS = ("content.json", "surface.csv", "height-map.png", "surface.png", "section.png")
"""Files that a reading may have."""


def write_content(directory: Path, content: Content) -> list[Path]:
    """Writes ``content.json``, ``surface.csv`` and the pictures that the reading allows; returns their paths.

    Files of these names that an earlier reading left are deleted.

    Raises `OSError` where the directory can't be written.
    """
    from siloscope.reporting.plots import save
    from siloscope.reporting.plots.content import pictures

    directory.mkdir(parents=True, exist_ok=True)
    written = [documents.write(directory / "content.json", content.to_dict())]
    if content.surface is not None:
        written.append(write_map(directory / "surface.csv", content.surface))
    written += [save(made, directory / f"{name}.png") for name, made in pictures(content).items()]
    return without_older(directory, written, RESULTS)


def write_map(path: Path, surface: SurfaceMap) -> Path:
    """Writes the map's cells inside the silo, one a line."""
    names = {number: name for name, number in KINDS.items()}
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for row, y in enumerate(surface.y):
            for column, x in enumerate(surface.x):
                if surface.inside[row, column]:
                    height, std = surface.heights[row, column], surface.std[row, column]
                    kind = names[int(surface.kinds[row, column])]
                    writer.writerow([f"{x:.4f}", f"{y:.4f}", f"{height:.5f}", f"{std:.5f}", kind])
    return path
