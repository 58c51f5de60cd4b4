// perception: what people can see of a fold, and of a picture. Include this header first.
//
// A Display turns pixels into angles and codes into cd/m2. A CsfTable is an observer: contrast sensitivity by
// frequency, luminance and eccentricity. The fold tests make a vdtree::DistanceCriterion of both for a tree, by
// FoldTestOptions. The judges say of two pictures which pixels differ visibly.
//
//     perception::FoldTestOptions options; // the default display at half a metre, the default observer, no gaze
//     view.fov_y_degrees = physical_field(options.display, view.height).value();
//     const auto criterion = perception::error_distances(tree, view, options); // a tree from measure_folds()
//     vdtree::Cut cut(tree);
//     const auto stats = cut.follow(*criterion, viewpoint_of(tree, view, options));
//
// Numbers with units are types of their own: 4.0_cpd, 100.0_cdm2, 2.0_deg. Models, formulas and sources: docs/model.md.
#pragma once

// Displays, observers and where they look.
#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/gaze.h>
#include <unseen/perception/units.h>

// Fold tests, and what is measured for them.
#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>

// Pictures, and judges of them.
#include <unseen/perception/image.h>
#include <unseen/perception/judge.h>
