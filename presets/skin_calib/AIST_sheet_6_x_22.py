import bpy

bpy.ops.skin_calib.skin_add(kind="sheet")
skin = bpy.context.object.skin_calib.skins[-1]
skin.rows = 6
skin.columns = 22
skin.pitch_mm = (10.0, 10.0)
