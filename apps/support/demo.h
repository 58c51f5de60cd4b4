// A first look without a model of one's own: a mesh, its tree, what nobody sees gone, and pictures of it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/function_ref.h>

#include "contact_sheet.h"

namespace unseen::app {

struct DemoModel {
    std::filesystem::path mesh;
    std::string name; // of files that are made of it
    std::string what; // for people
};

// The Stanford bunny, where Debian's package glmark2-data is installed; without it, or where `is_made` says so, a ball
// with bumps, which is written into the folder: the same at every time. Makes the folder.
Result<DemoModel> demo_model(const std::filesystem::path& folder, bool is_made = false);

// What is written of a model, by name.
struct DemoFiles {
    std::filesystem::path tree, mesh, sheet, maps;

    std::vector<std::string> names() const { return {tree.string(), mesh.string(), sheet.string(), maps.string()}; }
};
DemoFiles demo_files(const std::filesystem::path& folder, const DemoModel& model);

// Simplifies the session's only object for the default view, draws its cuts, and writes all files. `context`: null where
// there is no OpenGL: without pictures, whose names are emptied. `progress`: of the pictures.
struct Demo {
    session::Report imperceptible;
    std::vector<SheetCut> cuts; // of the sheet
};
Result<Demo> make_demo(session::Session& session, render::Context* context, const DemoModel& model, DemoFiles& files,
                       const Progress& progress = {});

// Whether windows can be opened, as far as the environment says: of X11 or of Wayland.
bool has_display();

} // namespace unseen::app
