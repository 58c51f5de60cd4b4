// The benchmarks: what each can be asked, and what measures it. All but the engine's, the libraries' and the people's
// need OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <unseen/session/selection.h>

#include "bench_table.h"

namespace unseen::app {

struct BenchOptions {
    std::vector<std::string> inputs;  // files that are read
    std::vector<std::string> outputs; // files that are written, beside the report
    bool quick = false;               // rough figures
};

// Cuts that follow a view, budgets, memory and building, against what was promised of them. Cuts are measured on one
// thread, pinned to one core, by the wall clock; medians. Trees are built by the command `unseen`, which tells its peak
// memory. Inputs: the mesh; if empty the dragon where quickstart has put it, else a sphere with bumps.
struct EngineOptions : BenchOptions {
    std::vector<std::uint64_t> sizes = {}; // triangles, ascending; smaller ones are simplified, larger ones subdivided
    std::string keep = {};                 // a folder for meshes and trees, used again if they are there
};
BenchReport bench_engine(const EngineOptions& options);

// What fold tests save, and whether anything of it can be seen; against what was promised. Inputs: the meshes and the
// others; if there are no meshes, installed ones.
inline constexpr std::array perception_groups = {"savings", "aside",     "random",  "far",
                                                 "hard",    "tolerance", "checked", "foliage"};
struct PerceptionOptions : BenchOptions {
    std::vector<std::string> meshes = {}; // of all groups
    std::vector<std::string> others = {}; // in the random views and far away, too
    std::vector<std::string> only = {};   // of perception_groups; empty: all
    int window_px = 1024;
    std::size_t random_views = 72;
    std::optional<std::uint64_t> seed = {}; // of random views; not set: drawn anew
};
BenchReport bench_perception(const PerceptionOptions& options);

// OpenMesh's clusterer beside ours, and CGAL's repair, on meshes as they come: what is left of borders and of edges that
// are not manifold or not consistent, how far the cut to a tenth of the triangles strays, time and memory.
BenchReport bench_libraries(const BenchOptions& options);

// Levels of detail beside those of meshoptimizer's simplification, of the same numbers of triangles, at the distances at
// which engines switch: what people would see, from the sides that the levels were looked at from. Inputs: meshes or
// trees; if empty corner_models.
BenchReport bench_lod(const BenchOptions& options);

// What pictures of budgets show beside meshoptimizer's simplification of as many triangles, by SSIM, PSNR and both judges, in
// three views; and how many times fewer of ours show as little. Inputs: meshes or trees; if empty corner_models.
struct QualityOptions : BenchOptions { // quick: the first view alone
    std::string plot = {}, sheet = {}; // of the first view: curves; pictures beside each other
    int window_px = 512;
};
BenchReport bench_quality(const QualityOptions& options);

// Varies one factor of the fold model at a time. Counts the triangles that the test by errors keeps in all views of a
// tuning set, and what the first judge sees of that. The tuning set has no mesh of the evidence.
struct FitOptions : BenchOptions {
    std::string factor = {}; // one of fit_factors(); empty: each
};
std::vector<std::string> fit_factors();
BenchReport bench_fit(const FitOptions& options);

// How models of contrast sensitivity, and observers, compare with people's thresholds (inputs: their table; if empty the
// checkout's); and the fits to these.
struct PeopleOptions : BenchOptions {
    bool channels = false; // instead: what the judges make of gratings in luminance and in each direction of colour
};
BenchReport bench_people(const PeopleOptions& options);

// What occlusion saves in scenes, what shows of it, and what discrete levels of detail make of the same. Each scene from
// its camera, with its lights, judged against the full scene.
struct ScenesOptions : BenchOptions {  // inputs: glTF files; if empty the four of `unseen make scene`
    std::uint64_t triangles = 500'000; // of each of these, about
    int window_px = 512;
    bool has_shadows = true; // if lights of the scenes cast any
};
BenchReport bench_scenes(const ScenesOptions& options);

// Levels selected beforehand, beside switching by area and by distance and the tree's own budget: what a flight shows of
// each, after tables 4.2 to 4.4 and 5.1 of Arlebrink and Linde (2018).
struct SelectionOptions : BenchOptions {
    std::vector<std::string> scenes = {};     // glTF files; empty: spheres, bunnies and models of `unseen make scene`
    std::vector<std::string> selections = {}; // by scene; empty: made anew
    std::vector<std::string> statues = {};    // of the scenes that are made
    std::uint64_t budget = 300'000;           // triangles
    int frames = 1000;
    int judged_every = 10;                // frames of which one is drawn and judged; levels follow all of them
    std::array<int, 2> size = {640, 360}; // pixels
    int samples = 4;                      // a pixel
    // By which levels are selected, each for itself, if no selections are given.
    std::vector<session::SelectionQuality> qualities = {session::SelectionQuality::ssim};
    double spacing = 0;  // of the search's grid, as in session::PrecomputeOptions
    int window_px = 256; // of the search's cameras
};
BenchReport bench_selection(const SelectionOptions& options);

// What accuracy costs: error against cost for the choices that the program makes, each by something else than what is
// varied. The axis of corners has models of its own, corner_models, unless there are inputs. Cost: a minute or two a model.
struct AccuracyOptions : BenchOptions { // inputs: meshes, trees and scenes; if empty what is installed, and made scenes
    bool has_scenes = false;            // the made ones, too, if there are models
    std::vector<std::string> only = {}; // keys of axes; empty: all
    std::string csv = {}, plots = {};   // a file with a line a point; a folder for a picture an axis
    double seconds = 300;               // for each model's ways to fold, at most
    int window_px = 512;
    bool is_brief = false; // the first table alone
};
std::vector<std::string> accuracy_axis_keys();
std::string accuracy_picture_name(const std::string& key); // accuracy_KEY.png
std::string corner_sheet_name(const std::string& subject); // corners_SUBJECT.png: a sheet of the axis of corners
BenchReport bench_accuracy(const AccuracyOptions& options);

} // namespace unseen::app
