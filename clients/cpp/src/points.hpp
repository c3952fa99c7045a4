/// @file
/// Points in messages.
#pragma once

#include <sketchmatch/v1/source.pb.h>

#include <sketchmatch/scene.hpp>
#include <sketchmatch/sources.hpp>
#include <vector>

namespace sketchmatch::detail {

inline v1::YAxis written(YAxis axis) {
  return axis == YAxis::down ? v1::Y_AXIS_DOWN : v1::Y_AXIS_UP;
}

inline void write_point(const Point& point, v1::Point& message) {
  message.set_x(point.x);
  message.set_y(point.y);
}

/// Adds points to a message that has some: a ring or a route.
template <typename Message>
void write_points(const std::vector<Point>& points, Message& message) {
  for (const auto& point : points) {
    write_point(point, *message.add_points());
  }
}

}  // namespace sketchmatch::detail
