# For Conan on a system whose own gRPC is to be taken: here that of Debian 12 and 13.
include(default)

[platform_requires]
grpc/1.51.1
protobuf/3.21.12
yaml-cpp/0.7.0

[platform_tool_requires]
grpc/1.51.1
protobuf/3.21.12
