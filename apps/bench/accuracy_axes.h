// The axes of `unseen-bench accuracy`, each in a file of its family. A function measures the points of one axis for one
// model; those of what does not depend on a model stand alone.
#pragma once

#include <string>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/session/session.h>

#include "accuracy_bench.h"

namespace unseen::app {

// A model before the default observer.
struct AccuracySubject {
    std::string name;
    session::Session& session;
    const render::Context& context;
    vdtree::View view;
    bool is_scene = false;
    double build_s = 0, measure_s = 0;      // of its trees, and of what their folds change; from files 0
    std::vector<std::string> left_out = {}; // by an axis: names of points and why, as sentences
};

using AccuracyPoints = std::vector<AccuracyPoint>;

// accuracy_folds.cpp
Result<AccuracyPoints> fold_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

// accuracy_bounds.cpp
Result<AccuracyPoints> sphere_points(AccuracySubject& subject, const AccuracyBenchOptions& options);
Result<AccuracyPoints> facing_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

// accuracy_sight.cpp
Result<AccuracyPoints> csf_points(const AccuracyBenchOptions& options);
Result<AccuracyPoints> map_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

// accuracy_levels.cpp
Result<AccuracyPoints> level_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

// accuracy_cuts.cpp
Result<AccuracyPoints> cut_points(AccuracySubject& subject, const AccuracyBenchOptions& options);
Result<AccuracyPoints> node_test_points(AccuracySubject& subject, const AccuracyBenchOptions& options);
Result<AccuracyPoints> tree_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

// accuracy_age.cpp
Result<AccuracyPoints> gaze_age_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

// accuracy_measurement.cpp
Result<AccuracyPoints> measurement_points(AccuracySubject& subject, const AccuracyBenchOptions& options);

} // namespace unseen::app
