"""The gRPC server: messages in, the pipeline, messages out."""
