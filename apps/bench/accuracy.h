// The axes of `unseen-bench accuracy`: choices that the program makes, each measured by something else than what is
// varied. Twins of what the program lacks are in the axes' files.
#pragma once

#include <string>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/session/session.h>

#include "bench_tools.h"

namespace unseen::app {

struct AccuracyAxis {
    std::string key;      // of --only, and in names of files
    std::string name;     // for people
    std::string question; // what it is about, in a sentence
    // What is measured of a point, with units: what it costs, what it is off by, then more.
    std::vector<std::string> columns;
};

// One choice of one axis.
struct AccuracyPoint {
    std::string name;
    std::vector<double> values; // of the axis's columns; NaN: does not apply
    std::string note = {};
    bool is_default = false;
    // Set for all points of an axis together:
    const AccuracyAxis* axis = nullptr;
    std::string subject = {};
    bool is_on_front = false; // of its axis and subject no other costs less and is nearer to the truth

    double cost() const { return values[0]; }
    double error() const { return values[1]; }
};
using AccuracyPoints = std::vector<AccuracyPoint>;

inline constexpr int accuracy_samples = 64; // a pixel, of pictures that are judged
inline constexpr int accuracy_repeats = 9;  // of what is timed
inline constexpr int few_repeats = accuracy_repeats / 3;

// A model before the default observer.
struct AccuracySubject {
    std::string name;
    session::Session session;
    const render::Context& context;
    vdtree::View view;
    bool is_scene = false;
    double build_s = 0, measure_s = 0;      // of its trees, and of what their folds change; from files 0
    double seconds = 0;                     // for the ways to fold, at most
    std::size_t nodes = 0;                  // whose bounds are looked at
    std::string pictures = {};              // a folder for what an axis draws of it; empty: not wanted
    std::vector<std::string> left_out = {}; // by an axis: names of points and why, as sentences
};

// The points of one axis for one model.
AccuracyPoints fold_points(AccuracySubject& subject);
AccuracyPoints sphere_points(AccuracySubject& subject);
AccuracyPoints facing_points(AccuracySubject& subject);
AccuracyPoints map_points(AccuracySubject& subject);
AccuracyPoints level_points(AccuracySubject& subject);
AccuracyPoints cut_points(AccuracySubject& subject);
AccuracyPoints node_test_points(AccuracySubject& subject);
AccuracyPoints tree_points(AccuracySubject& subject);
AccuracyPoints corner_points(AccuracySubject& subject); // and a picture of them
AccuracyPoints gaze_age_points(AccuracySubject& subject);
AccuracyPoints measurement_points(AccuracySubject& subject);
// For no model.
AccuracyPoints csf_points();

inline session::Request picture_request() { return {.purpose = session::Purpose::picture, .reasons = false}; }

std::string accuracy_number(double value); // for people; empty if it is NaN

// A picture for each axis that has points, of the first model and of the last one.
void write_accuracy_pictures(const std::vector<const AccuracyAxis*>& axes, const AccuracyPoints& points,
                             const std::string& folder);

} // namespace unseen::app
