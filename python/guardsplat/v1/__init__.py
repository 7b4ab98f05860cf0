"""The messages of the service's API, generated from ``proto/guardsplat/v1`` (``deploy/python.sh protos``)."""
