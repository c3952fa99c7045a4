/// @file
/// What servers answer, in a line or a small table.
#pragma once

#include <ostream>
#include <sketchmatch/catalogue.hpp>
#include <sketchmatch/match.hpp>
#include <sketchmatch/scene.hpp>
#include <string>

namespace sketchmatch {

/// Returns what came out of a match: a line that sums it up, and which object is which.
std::string summary(const Match& match);
/// Returns how far a match is, in a line.
std::string summary(const Progress& progress);
/// Returns the objects of a source in a table.
std::string summary(const Segmentation& found);
/// Returns the algorithms of a server in a table.
std::string summary(const Catalogue& catalogue);

/// Returns what an outcome is called, e.g. "OPTIMAL"; its number where only newer servers know it.
std::string name_of(Outcome outcome);
/// Returns what a phase is called, e.g. "SEARCH".
std::string name_of(Phase phase);
/// Returns what a kind of algorithms is called, e.g. "SEARCHER".
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
