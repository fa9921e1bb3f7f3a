# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin that is proposed, as a menu and sizes: they show and change the text that the scene or the preferences keep.

The text is that of the command line, so that scripts and scenes of every version have one value.
"""

from typing import Any

from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ...proposal.skins import DEFAULT_SKIN, Form, form_of

KINDS = [
    ("hexagons", "Hexagons", "Rigid hexagonal boards of one size, which fill each surface"),
    ("sheet", "Sheet", "A sheet of taxels of this size in the middle of each surface that has space"),
    ("file", "File", "The skin of a JSON file, as in a plan"),
]
USUAL = ("usual", "As in Preferences", "The skin in the preferences of the extension")
# What a kind starts with; the sheet is that of AIST.
FIRST = {"hexagons": DEFAULT_SKIN, "sheet": "sheet:6x22x10mm", "file": "//skin.json", "usual": ""}
# Properties that a panel shows for a kind, with their labels.
SIZES = {
    "hexagons": {"skin_length_mm": "Side"},
    "sheet": {"skin_rows": "Rows", "skin_columns": "Columns", "skin_length_mm": "Pitch"},
    "file": {"skin_file": "File"},
    "usual": {},
}


def in_words(text: str) -> str:
    """Return a skin as the window names it."""
    form = form_of(text)
    label = next(label for name, label, _ in KINDS if name == form.kind)
    taxels = f"{form.rows} x {form.columns} taxels, " if form.kind == "sheet" else ""
    return f"{label}: {text if form.kind == 'file' else f'{taxels}{form.length:g} mm'}"


def fields_of(is_scene: bool) -> dict[str, Any]:
    """Return the properties of a group that has the text ``skin``; in a scene it may be empty."""
    kinds = [USUAL, *KINDS] if is_scene else KINDS
    names = [name for name, _, _ in kinds]

    def kind(group: Any) -> int:
        return names.index("usual" if is_scene and not group.skin else form_of(group.skin).kind)

    def set_kind(group: Any, index: int) -> None:
        if index != kind(group):
            group.skin = FIRST[names[index]]

    def set_file(group: Any, path: str) -> None:
        group.skin = path or FIRST["file"]

    length = (
        "Side of a board, or distance of the taxels of a sheet. Boards of TUM have 16.3 mm, the sheet of AIST 10 mm"
    )
    return {
        "skin_kind": EnumProperty(
            name="Proposed Skin",
            description="What Propose puts on links",
            items=kinds,
            get=kind,
            set=set_kind,
            options=set(),
        ),
        "skin_length_mm": FloatProperty(
            name="Size", description=length, min=0.1, unit="CAMERA", precision=4, step=10, **_view("length")
        ),
        "skin_rows": IntProperty(name="Rows", description="Rows of taxels", min=1, **_view("rows")),
        "skin_columns": IntProperty(name="Columns", description="Taxels of a row", min=1, **_view("columns")),
        "skin_file": StringProperty(
            name="File",
            description="A JSON file with a sheet or hexagons, as in the skins of a plan",
            subtype="FILE_PATH",
            get=lambda group: group.skin,
            set=set_file,
            options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        ),
    }


def _view(name: str) -> dict[str, Any]:
    """Return what a property of one size of the skin needs."""

    def store(group: Any, value: Any) -> None:
        form: Form = form_of(group.skin)
        if form.kind != "file":
            group.skin = form._replace(**{name: value}).text

    return {"get": lambda group: getattr(form_of(group.skin), name), "set": store, "options": set()}
