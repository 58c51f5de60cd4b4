// render: draws cuts with OpenGL 4.5, off screen or in a window. The header to include first.
//
// A Context is an OpenGL context. A Renderer draws one tree's cuts as pictures of linear luminance and colour. For
// scenes, a GpuTree is a tree's vertices on the GPU, a GpuCut follows a cut, and draw() puts items into a Target.
//
//     auto context = render::Context::headless();
//     auto renderer = render::Renderer::create(*context, tree);
//     vdtree::Cut cut(tree);
//     cut.unfold_all();
//     auto frame = renderer->draw(cut, view); // frame->luminance[row * frame->width + column], rows from the top
//
// A context and all that is in it belong to the thread that made it.
#pragma once

#include <unseen/render/context.h>
#include <unseen/render/draw.h>
#include <unseen/render/renderer.h>
#include <unseen/render/sample_sum.h>
#include <unseen/render/shadows.h>
#include <unseen/render/target.h>
