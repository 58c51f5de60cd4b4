// calibration: profiles of displays, observers and lights, and the procedures that measure them. The header to include first.
//
// Profiles are JSON files whose keys carry their units. A Procedure measures an observer: it gives the next grating and
// takes the answer; the caller shows the gratings and asks.
//
//     const auto display = calibration::read_display("data/displays/tv-55in-3840x2160.json");
//     const auto& expected = perception::CsfTable::standard();
//     auto procedure = calibration::Procedure::create(calibration::plan_for(*display, expected), expected);
//     while (!procedure->is_done()) show(procedure->next()), procedure->choose(ask()); // interval 1 or 2
//     const auto measured = procedure->table("me");
#pragma once

#include <unseen/calibration/display_profile.h>
#include <unseen/calibration/light_rig.h>
#include <unseen/calibration/observer_profile.h>
#include <unseen/calibration/procedure.h>
#include <unseen/calibration/study.h>
