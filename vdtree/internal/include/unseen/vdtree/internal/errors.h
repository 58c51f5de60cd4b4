// Errors by their codes, for `return invalid_argument("...");`.
#pragma once

#include <unseen/vdtree/result.h>

namespace unseen {

inline Error invalid_argument(Message message) { return {ErrorCode::invalid_argument, std::move(message)}; }
// A message that names fields: see Message::of().
inline Error invalid_field(std::string_view text, std::initializer_list<std::string_view> values = {}) {
    return invalid_argument(Message::of(text, values));
}
inline Error unsupported(Message message) { return {ErrorCode::unsupported, std::move(message)}; }

} // namespace unseen
