/// @file
/// The contract as it goes over the wire: generated messages and stubs, for whoever needs more than
/// the client offers. `Client::channel`, `Client::authorize` and `Client::check` go with them.
#pragma once

#include <grpcpp/grpcpp.h>
#include <sketchmatch/v1/catalog_service.grpc.pb.h>
#include <sketchmatch/v1/errors.pb.h>
#include <sketchmatch/v1/match_service.grpc.pb.h>
#include <sketchmatch/v1/scene_service.grpc.pb.h>
#include <sketchmatch/v1/sketch_service.grpc.pb.h>
#include <sketchmatch/v1/transfer_service.grpc.pb.h>

#include <sketchmatch/client.hpp>
