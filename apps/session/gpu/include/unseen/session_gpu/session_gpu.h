// session_gpu: drawing sessions with OpenGL, and judging the pictures. Include this first.
//
// - SceneRenderer draws all objects of a session and what surrounds them.
// - simplify_as_seen() also folds whatever the picture hides; simplify_checked() as much as pictures show nothing of.
// - PictureJudge judges what cuts show in a view; GpuJudge is perception::Judge on the GPU.
// - measure_tradeoff() measures what accuracy costs in one view.
// - make_levels() makes levels of detail for engines, with the distances from which nobody sees them.
// - LevelControl chooses among few levels by what the rest of a picture masks; precompute_selections() selects levels for
//   cameras all over a scene.
// - draw_study_pairs() draws the pictures of a study.
#pragma once

#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/checked.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/lod.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/precompute_selections.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/session_gpu/study_pictures.h>
#include <unseen/session_gpu/tradeoff.h>
