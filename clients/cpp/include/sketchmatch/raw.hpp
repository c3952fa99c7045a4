/// @file
/// The generated messages and stubs of the contract, for programs that need more than the client
/// offers. Use them with `Client::channel`, `Client::authorize` and `Client::check`.
#pragma once

#include <grpcpp/grpcpp.h>
#include <sketchmatch/v1/catalog_service.grpc.pb.h>
#include <sketchmatch/v1/errors.pb.h>
#include <sketchmatch/v1/match_service.grpc.pb.h>
#include <sketchmatch/v1/scene_service.grpc.pb.h>
#include <sketchmatch/v1/sketch_service.grpc.pb.h>
#include <sketchmatch/v1/transfer_service.grpc.pb.h>

#include <sketchmatch/client.hpp>
