/// @file
/// All of the client: ask a sketchmatch server which sketched object is which object on a map.
#pragma once

#include <sketchmatch/cancellation.hpp>
#include <sketchmatch/catalogue.hpp>
#include <sketchmatch/client.hpp>
#include <sketchmatch/errors.hpp>
#include <sketchmatch/match.hpp>
#include <sketchmatch/options.hpp>
#include <sketchmatch/scene.hpp>
#include <sketchmatch/sources.hpp>
#include <sketchmatch/stored.hpp>
#include <sketchmatch/summary.hpp>
#include <sketchmatch/transfer.hpp>
#include <sketchmatch/value.hpp>
#include <sketchmatch/version.hpp>
