import bpy

bpy.ops.skin_calib.skin_add(kind="hexagons")
skin = bpy.context.object.skin_calib.skins[-1]
skin.side_mm = 8.0
skin.auto_gap = False
skin.gap_mm = 0.0
skin.choice = "fill"
skin.offset_mm = 0.0
