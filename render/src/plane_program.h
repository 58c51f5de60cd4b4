// Programs that compute planes: planes.glsl before the shader's own text.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "context_impl.h"
#include "shaders.h"

namespace unseen::render {

inline Result<const Program*> plane_program(const Context& context, std::string_view label, std::string_view fragment,
                                            std::initializer_list<std::string_view> defines = {}) {
    const std::string text = std::string(shaders::planes_glsl) + "#line 1\n" + std::string(fragment);
    const ShaderSource sources[] = {{ShaderSource::Stage::vertex, shaders::full_screen_vert},
                                    {ShaderSource::Stage::fragment, text}};
    return context.impl().programs.named(label, sources, {defines.begin(), defines.size()});
}

// Programs by name, found when they are first needed; the first error is kept.
class PlanePrograms {
public:
    explicit PlanePrograms(const Context& context) : context_(context) {}

    bool find(const Program*& program, std::string_view label, std::string_view fragment,
              std::initializer_list<std::string_view> defines = {}) {
        if (program || error_) return !error_;
        const auto found = plane_program(context_, label, fragment, defines);
        if (found) program = *found;
        else error_ = found.error();
        return !error_;
    }
    Result<void> result() const { return error_ ? Result<void>(*error_) : Result<void>(); }

private:
    const Context& context_;
    std::optional<Error> error_;
};

} // namespace unseen::render
