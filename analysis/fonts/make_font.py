"""Reduce Liberation Sans to the characters of figures: Latin, Greek and a few signs, without hinting.

usage: make_font.py LiberationSans-Regular.ttf HoofprintSans-Regular.ttf   (needs fonttools)

Source: Liberation Fonts 2.1.5 (https://github.com/liberationfonts), SIL Open Font License 1.1. The licence
reserves the name "Liberation" for the unchanged fonts, so the result has another name. The widths are those of
Arial, so an SVG with the font Arial and a bitmap of this font have the same layout.
"""

import sys

from fontTools import subset
from fontTools.ttLib import TTFont

FAMILY = "Hoofprint Sans"
CODE_POINTS = [
    *range(0x20, 0x7F),  # ASCII
    *range(0xA0, 0x100),  # Latin-1
    *range(0x391, 0x3CA),  # Greek
    0x2013, 0x2014, 0x2018, 0x2019, 0x201C, 0x201D, 0x2022, 0x2026,  # dashes, quotes, bullet, ellipsis
    0x2190, 0x2191, 0x2192, 0x2193, 0x2212, 0x2248, 0x2264, 0x2265,  # arrows, minus, comparisons
]

source, target = sys.argv[1:]
options = subset.Options(hinting=False, layout_features=["kern"], notdef_outline=True, name_IDs=[0, 1, 2, 3, 4, 6, 13, 14])
font = TTFont(source, recalcTimestamp=False)
subsetter = subset.Subsetter(options)
subsetter.populate(unicodes=CODE_POINTS)
subsetter.subset(font)
for record in font["name"].names:
    renamed = {1: FAMILY, 3: f"{FAMILY} Regular, after Liberation Sans 2.1.5", 4: FAMILY, 6: "HoofprintSans-Regular"}
    if record.nameID in renamed:
        record.string = renamed[record.nameID]
font.save(target)
