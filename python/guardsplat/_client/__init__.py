"""The client of a server, in pure Python over grpcio."""
