def engraved(tile, strokes, around): return ()
def eyes(tile, given): return ()
