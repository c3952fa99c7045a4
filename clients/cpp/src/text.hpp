/// @file
/// Texts: UTF-8, values in errors, and reading files.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace sketchmatch::detail {

/// Throws the error of a field that cannot be used.
[[noreturn]] void refuse(const std::string& field, const std::string& problem,
                         const std::string& reason = "INVALID_FIELD");

/// Whether bytes are UTF-8, as texts of messages must be.
bool is_utf8(std::string_view bytes);

/// Returns a text of a message.
/// @throws InvalidRequestError If it is not UTF-8.
const std::string& checked_text(const std::string& text, const std::string& field);

/// Returns a text in quotes, shortened and without control sequences for terminals.
std::string in_quotes(std::string_view text);

/// Returns a number as people write it: 2.5, 60, nan.
std::string shown(double number);

/// Returns a pattern with its first `{}` replaced by a text.
std::string filled(std::string_view pattern, std::string_view value);

/// Whether a text begins with another.
bool starts_with(std::string_view text, std::string_view head);

/// Returns a text in lower case, as far as it is ASCII.
std::string lowered(std::string text);

/// Returns a text without spaces at both ends.
std::string stripped(std::string_view text);

/// Returns the content of a file.
/// @throws std::system_error With the reason, if it cannot be read.
std::string read_bytes(const std::filesystem::path& path);

/// Returns a path as it is.
std::string text_of(const std::filesystem::path& path);

}  // namespace sketchmatch::detail
