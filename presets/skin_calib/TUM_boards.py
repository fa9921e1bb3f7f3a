import bpy

bpy.ops.skin_calib.skin_add(kind="hexagons")
skin = bpy.context.object.skin_calib.skins[-1]
skin.side_mm = 16.3
skin.auto_gap = True
skin.choice = "fill"
skin.offset_mm = 0.0
