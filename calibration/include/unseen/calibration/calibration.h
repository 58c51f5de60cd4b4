// calibration: measured facts about displays, observers and lights, and measuring them. The header to include first.
//
// Profiles are JSON files whose keys carry their units: read_display() gives a perception::Display, read_csf() a
// perception::CsfTable, LightRig::read() the lights of a scene. A Procedure measures an observer: it says which grating
// comes next and takes the answer.
//
//     const auto display = calibration::read_display("data/displays/tv-55in-3840x2160.json");
//     const auto& expected = perception::CsfTable::standard();
//     auto procedure = calibration::Procedure::create(calibration::plan_for(*display, expected), expected);
//     while (!procedure->is_done()) show(procedure->next()), procedure->choose(ask()); // interval 1 or 2
//     const auto measured = procedure->table("me");
//
// No window and no keys: showing and asking are the caller's.
#pragma once

// Profiles.
#include <unseen/calibration/display_profile.h>
#include <unseen/calibration/light_rig.h>
#include <unseen/calibration/observer_profile.h>
#include <unseen/calibration/people.h>

// Measuring.
#include <unseen/calibration/display_fit.h>
#include <unseen/calibration/procedure.h>
#include <unseen/calibration/quest.h>
#include <unseen/calibration/sensitivity_field.h>
#include <unseen/calibration/simulated_observer.h>

// Studies.
#include <unseen/calibration/picture_observer.h>
#include <unseen/calibration/study.h>
