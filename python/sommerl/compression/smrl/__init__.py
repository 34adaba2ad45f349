"""The format .smrl: its writer, its reader, and decoders to read and compare."""
