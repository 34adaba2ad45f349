"""The file format .smrl: writer and reader, and a second decoder in plain Python that serves as the specification."""
