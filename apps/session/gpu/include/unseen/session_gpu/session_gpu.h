// session_gpu: where a session meets OpenGL. The header to include first.
//
// A SceneRenderer draws all objects of a session with what stands around them. simplify_as_seen() folds what lies behind
// what a picture shows, and what the scene masks. A GpuJudge
// is perception::Judge on the GPU. A LevelControl chooses among few levels of detail by what the rest of a picture masks;
// precompute_selections() selects levels for cameras all over a scene. measure_tradeoff() tells what accuracy costs in one
// view. draw_study_pairs() makes the pictures of a study. make_levels() makes levels of detail with the distances from
// which nobody sees them, for engines that show few meshes; a PictureJudge says what cuts show in a view.
#pragma once

#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/frame_image.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/level_pictures.h>
#include <unseen/session_gpu/lod.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/precompute_selections.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/session_gpu/study_pictures.h>
#include <unseen/session_gpu/tradeoff.h>
