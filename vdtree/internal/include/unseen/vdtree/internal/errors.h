// Errors by their codes, for `return invalid_argument("...");`.
#pragma once

#include <string>
#include <utility>

#include <unseen/vdtree/result.h>

namespace unseen {

inline Error invalid_argument(std::string message) { return {ErrorCode::invalid_argument, std::move(message)}; }
inline Error unsupported(std::string message) { return {ErrorCode::unsupported, std::move(message)}; }

} // namespace unseen
