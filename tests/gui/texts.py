"""The texts that the panels of the sidebar draw, and those that are cut off: Blender does not report it."""

import blf
import bpy

# Widths in Blender's sidebar, measured on screenshots [pixel of a screen with standard density].
EDGES = 52  # left and right of what a panel contains, with the tabs
BOX = 9  # left and right of what a box contains
ICON = 20
PADDING = 4  # left and right of a text
NUMBER = 24  # left, right and between of label and value of a number
LABEL_PART = 0.4  # fraction of the width for labels next to fields


class Texts:
    """Records while the sidebar is drawn. ``drawn`` has the texts, ``cut`` those that are too wide for their panel."""

    def __init__(self):
        self.drawn, self.cut = [], set()
        for name in dir(bpy.types):
            panel = getattr(bpy.types, name)
            if name.startswith("SKIN_PT_") and panel.bl_region_type == "UI":
                panel.draw = self._recorded(panel.draw)

    def clear(self):
        """Forget what was drawn."""
        self.drawn.clear()
        self.cut.clear()

    def _recorded(self, draw):
        def recorded(panel, context):
            top = Part(panel.layout, self.drawn)
            draw(Panel(panel, top), context)
            scale = context.preferences.system.ui_scale
            self.cut |= {(context.region.width, *found) for found in top.too_wide(context.region.width / scale - EDGES)}

        return recorded


class Panel:
    """A panel with another layout."""

    def __init__(self, panel, layout):
        self._panel, self.layout = panel, layout

    def __getattr__(self, name):
        return getattr(self._panel, name)


class Part:
    """A layout that records the widths of what it draws: one below the other, or in a row."""

    def __init__(self, layout, drawn, kind="column", space=0):
        self.__dict__.update(_layout=layout, _drawn=drawn, _kind=kind, _space=space, _parts=[])

    def __getattr__(self, name):
        return getattr(self._layout, name)

    def __setattr__(self, name, value):
        setattr(self._layout, name, value)

    def too_wide(self, width):
        """Yield the texts of rows that are wider than a width, with what they need and what they have."""
        width -= self._space
        if self._kind == "row":
            if self.need() > width + self._space:
                yield " | ".join(self.texts()), round(self.need()), round(width)
            return
        for part in self._parts:
            if isinstance(part, Part):
                yield from part.too_wide(width)
            elif part[1] > width:
                yield part[0], round(part[1]), round(width)

    def need(self):
        """Return the width that all texts need."""
        needs = [part.need() if isinstance(part, Part) else part[1] for part in self._parts]
        return self._space + (sum(needs) if self._kind == "row" else max(needs, default=0))

    def texts(self):
        """Return all texts."""
        return [t for part in self._parts for t in (part.texts() if isinstance(part, Part) else [part[0]]) if t]

    def _add(self, text, width):
        self._drawn.append(text)
        self._parts.append((text, width))

    def _part(self, layout, kind, space=0):
        part = Part(layout, self._drawn, kind, space)
        self._parts.append(part)
        return part

    def row(self, **words):
        return self._part(self._layout.row(**words), "row")

    def column(self, **words):
        return self._part(self._layout.column(**words), "column")

    def box(self):
        return self._part(self._layout.box(), "column", BOX)

    def grid_flow(self, columns=1, **words):
        flow = self._part(self._layout.grid_flow(columns=columns, **words), "column")
        flow.__dict__["_columns"] = columns
        return flow

    def panel_prop(self, data, name):
        header, body = self._layout.panel_prop(data, name)
        return self._part(header, "row", ICON), body and self._part(body, "column")

    def label(self, text="", icon="NONE", **words):
        self._add(text, width_of(text) + PADDING + ICON * (icon != "NONE"))
        self._layout.label(text=text, icon=icon, **words)

    def operator(self, name, text=None, icon="NONE", **words):
        module, short = name.split(".")
        shown = getattr(getattr(bpy.ops, module), short).get_rna_type().name if text is None else text
        self._add(shown, width_of(shown) + PADDING * bool(shown) + ICON * (icon != "NONE"))
        return self._layout.operator(name, icon=icon, **words, **({} if text is None else {"text": text}))

    def operator_menu_enum(self, *names, **words):
        self._add(words["text"], width_of(words["text"]) + 2 * ICON)
        return self._layout.operator_menu_enum(*names, **words)

    def menu(self, *names, **words):
        self._add(words["text"], width_of(words["text"]) + 2 * ICON)
        self._layout.menu(*names, **words)

    def prop_enum(self, data, name, value, **words):
        text = data.bl_rna.properties[name].enum_items[value].name
        self._add(text, (width_of(text) + 2 * PADDING) * self.__dict__.get("_columns", 1))
        self._layout.prop_enum(data, name, value, **words)

    def prop(self, data, name, text=None, icon="NONE", **words):
        item = data.bl_rna.properties[name]
        label, value = item.name if text is None else text, 0
        if item.type in ("FLOAT", "INT") and (not item.is_array or "index" in words):
            found = getattr(data, name)
            value = width_of(value_text(item, found[words["index"]] if item.is_array else found)) + NUMBER
        if item.type == "BOOLEAN":
            label, value = "", width_of(label) + PADDING * bool(label) + ICON
        if words.get("expand"):
            value = sum(width_of(one.name) + 2 * PADDING for one in item.enum_items)
            label = label if self._layout.use_property_split else ""  # Blender draws none
        if self._layout.use_property_split:
            need = max((width_of(label) + PADDING) / LABEL_PART if label else 0, value / (1 - LABEL_PART))
        else:
            need = width_of(label) + value
        self._add(item.name if text is None else text, need)
        self._layout.prop(data, name, icon=icon, **words, **({} if text is None else {"text": text}))


def width_of(text):
    """Return the width of a text [pixel of a screen with standard density]."""
    preferences = bpy.context.preferences
    scale = preferences.system.ui_scale
    blf.size(0, preferences.ui_styles[0].widget.points * scale)
    return blf.dimensions(0, text)[0] / scale


def value_text(item, value):
    """Return a number as Blender shows it."""
    if item.type == "INT":
        return str(value)
    unit = {"CAMERA": " mm", "TIME_ABSOLUTE": " s", "ROTATION": "°"}.get(item.unit)
    return f"{value:.4g}{unit}" if unit else f"{value:.{min(item.precision, 3)}f}"
