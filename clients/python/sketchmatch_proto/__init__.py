"""The messages and stubs of the gRPC contract, generated from ``proto/`` of sketchmatch.

Engine and client share this package. ``sketchmatch_proto.v1`` has one ``…_pb2`` module for each
``.proto`` file and one ``…_pb2_grpc`` module for each service; ``proto/generate.py`` writes them.
"""
