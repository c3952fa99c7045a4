/// @file
/// Sketches and maps to hand to a client, from what people and robots have at hand.
///
/// These functions check the form of what they are given. Whether a stroke makes an object, or a
/// map shows anything, is the server's to say.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <sketchmatch/scene.hpp>
#include <string>
#include <vector>

namespace sketchmatch {

namespace v1 {
class Source;
}

/// A picture of a place in one of the forms that servers take; cheap to copy.
class Source {
 public:
  /// Takes a message of the contract; the functions in `sketchmatch::sources` make them.
  explicit Source(const v1::Source& message, std::vector<std::string> notes = {});

  /// The message of the contract; include `<sketchmatch/raw.hpp>` to look into it.
  [[nodiscard]] const v1::Source& message() const noexcept { return *message_; }

  /// What was decided on the way, in sentences, such as which picture a map was read from.
  [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

 private:
  std::shared_ptr<const v1::Source> message_;
  std::vector<std::string> notes_;
};

/// Which way y grows: screens, tablets and pictures deliver `down`. A sketch that is read with the
/// wrong axis is its own mirror image, and cannot match.
enum class YAxis { up, down };

/// Where the pen was, and perhaps when.
struct StrokePoint {
  double x = 0.0;                 ///< To the right, in units of any size.
  double y = 0.0;                 ///< Up or down by the `YAxis`.
  std::optional<double> seconds;  ///< Since any moment that is the same for the whole sketch.

  StrokePoint() = default;
  /// A point of the pen.
  StrokePoint(double right, double upwards, std::optional<double> time = std::nullopt)
      : x(right), y(upwards), seconds(time) {}
};

/// Where a grid lies.
struct Pose {
  double x = 0.0;    ///< Metres along the x axis of the map's frame.
  double y = 0.0;    ///< Metres along its y axis.
  double yaw = 0.0;  ///< Radians counter-clockwise from the x axis.
};

namespace sources {

/// Returns a sketch of pen strokes.
/// @param strokes For each stroke its points.
/// @param labels A name for each stroke, or none at all.
/// @param y_axis `down` for points from a screen or tablet.
/// @throws InvalidRequestError If labels are not as many, or no UTF-8.
Source strokes(const std::vector<std::vector<StrokePoint>>& strokes,
               const std::vector<std::string>& labels = {}, YAxis y_axis = YAxis::up);

/// Returns a sketch or map of polygons without holes.
/// @param outlines For each object the corners of its outline.
/// @param labels A name for each polygon, or none at all.
/// @param y_axis Which way y grows.
/// @param certainties How sure it is, above 0 and up to 1, that each polygon is one thing; none
///   where it is, or none at all.
/// @throws InvalidRequestError As `strokes`.
Source polygons(const std::vector<Ring>& outlines, const std::vector<std::string>& labels = {},
                YAxis y_axis = YAxis::up,
                const std::vector<std::optional<double>>& certainties = {});

/// Returns a sketch or map of polygons, each an outline and its holes, if any.
/// @throws InvalidRequestError As `strokes`.
Source polygons_with_holes(const std::vector<std::vector<Ring>>& polygons,
                           const std::vector<std::string>& labels = {}, YAxis y_axis = YAxis::up,
                           const std::vector<std::optional<double>>& certainties = {});

/// Returns a scene that the server keeps, by the name that it was given when it was put.
/// @throws InvalidRequestError If the name is no UTF-8.
Source stored_scene(const std::string& name);

/// Returns a robot's occupancy grid as a map.
/// @param cells −1 unknown, 0 free … 100 occupied, row by row from the lowest: `data` of a ROS
///   `nav_msgs/OccupancyGrid`.
/// @param columns Cells in a row: `info.width`.
/// @param resolution Metres a cell: `info.resolution`.
/// @param origin Where the lower left corner of the grid lies.
/// @throws InvalidRequestError If the cells are no rectangle of so many columns.
Source occupancy_grid(const std::vector<std::int8_t>& cells, std::uint32_t columns,
                      double resolution, const Pose& origin = {});

/// Returns a map as ROS map_server saved it.
/// @param path The .yaml file; or the picture, which a .yaml beside it names; or the folder that
///   holds one map. A picture that is not where the .yaml says is taken from beside it, which
///   `Source::notes` tells. So is the file beside it, of its name and ending in .objects.geojson,
///   that says what its objects are, as `sketchmatch segment --out` saves it; the server ignores
///   one that was made for an earlier state of the map.
/// @throws InvalidRequestError If the file or its picture cannot be read, or it names none.
Source map_server_map(const std::filesystem::path& path);

/// Returns a picture of a map or of a sketch: a PNG, JPEG, WebP, GIF, BMP,
/// TIFF or PGM file.
/// @throws InvalidRequestError If the file cannot be read.
Source image(const std::filesystem::path& path);

/// Returns a picture from the bytes of its file.
Source image_of(const std::string& bytes);

/// Returns a file that the server reads: a drawing in SVG, strokes in JSON, polygons in GeoJSON, a
/// picture, a ROS bag, or one of another tool, as `Client::algorithms` lists them under `readers`.
/// @param path The file.
/// @param part Which part of it to read, such as layers of a drawing or the topic of a bag.
/// @param name Its name, of which the ending tells what it is, in place of the file's own.
/// @throws InvalidRequestError If the file cannot be read.
Source file(const std::filesystem::path& path, const std::string& part = {},
            const std::string& name = {});

/// Returns a file from its bytes.
/// @param bytes What is in it.
/// @param name Its name, of which the ending tells what it is.
/// @param part Which part of it to read.
/// @throws InvalidRequestError If the name is empty.
Source file_of(const std::string& bytes, const std::string& name, const std::string& part = {});

}  // namespace sources
}  // namespace sketchmatch
