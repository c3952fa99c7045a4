/// @file
/// Texts: what is UTF-8, how values are shown in errors, and how files are read.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace sketchmatch::detail {

/// Throws the error of a field that cannot be used.
[[noreturn]] void refuse(const std::string& field, const std::string& problem,
                         const std::string& reason = "INVALID_FIELD");

/// Whether bytes are UTF-8, which alone may stand in a text of a message.
bool is_utf8(std::string_view bytes);

/// Returns a text of a message.
/// @throws InvalidRequestError If it is no UTF-8.
const std::string& checked_text(const std::string& text, const std::string& field);

/// Returns a text in quotes, cut and without what a terminal would take for a command.
std::string in_quotes(std::string_view text);

/// Returns a number as people write it: 2.5, 60, nan.
std::string shown(double number);

/// Returns a text with the first of a pattern's places replaced; `{}` is the place.
std::string filled(std::string_view pattern, std::string_view value);

/// Whether a text begins with another.
bool starts_with(std::string_view text, std::string_view head);

/// Returns a text in lower case, as far as it is ASCII.
std::string lowered(std::string text);

/// Returns a text without spaces at both ends.
std::string stripped(std::string_view text);

/// Returns what is in a file.
/// @throws std::system_error With the reason, if it cannot be read.
std::string read_bytes(const std::filesystem::path& path);

/// Returns a path as it is.
std::string text_of(const std::filesystem::path& path);

}  // namespace sketchmatch::detail
