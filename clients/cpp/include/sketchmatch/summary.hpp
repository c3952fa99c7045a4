/// @file
/// Answers of servers as a line or a small table.
#pragma once

#include <ostream>
#include <sketchmatch/catalogue.hpp>
#include <sketchmatch/match.hpp>
#include <sketchmatch/scene.hpp>
#include <string>

namespace sketchmatch {

/// Returns a line that summarises a match, and a table of which object is which.
std::string summary(const Match& match);
/// Returns a line that says how far a match is.
std::string summary(const Progress& progress);
/// Returns the objects of a source in a table.
std::string summary(const Segmentation& found);
/// Returns the algorithms of a server in a table.
std::string summary(const Catalogue& catalogue);

/// Returns the name of an outcome, e.g. "OPTIMAL", or its number if this client does not know it.
std::string name_of(Outcome outcome);
/// Returns the name of a phase, e.g. "SEARCH".
std::string name_of(Phase phase);
/// Returns the name of a kind of algorithms, e.g. "SEARCHER".
std::string name_of(AlgorithmKind kind);

/// Writes the summary of a match.
std::ostream& operator<<(std::ostream& out, const Match& match);
/// Writes the summary of a progress.
std::ostream& operator<<(std::ostream& out, const Progress& progress);
/// Writes the summary of a segmentation.
std::ostream& operator<<(std::ostream& out, const Segmentation& found);
/// Writes the summary of a catalogue.
std::ostream& operator<<(std::ostream& out, const Catalogue& catalogue);

}  // namespace sketchmatch
