// Answers of a process to the library, and what turns exceptions into one.
#ifndef TRACER_READER_REPLY_H
#define TRACER_READER_REPLY_H

#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>

#include "image/protocol.h"
#include "system.h"
#include "tracer/base.h"

// A failure with a status that is more than IMAGE.
class Failure : public std::runtime_error {
  public:
    Failure(trc_status status, const std::string &reason)
        : std::runtime_error(reason), status_(status) {}
    trc_status status() const { return status_; }

  private:
    trc_status status_;
};

// The library has gone: there is nobody to answer.
class Gone {};

inline void reply(connection &to, const trc_reader_answer &answer) {
    if (!connection_send(&to, &answer, sizeof answer))
        throw Gone();
}

inline trc_reader_answer answer_of(uint32_t kind) {
    trc_reader_answer answer = {};
    answer.magic = TRC_READER_MAGIC;
    answer.kind = kind;
    return answer;
}

inline void reply_failure(connection &to, trc_status status, const char *reason) {
    trc_reader_answer answer = answer_of(TRC_READER_FAILED);
    answer.status = status;
    std::strncpy(answer.text, reason, sizeof answer.text - 1);
    reply(to, answer);
}

// Runs a function and answers for what it throws.
template <typename Function> void guarded(connection &to, Function function) {
    try {
        function();
    } catch (const Failure &failure) {
        reply_failure(to, failure.status(), failure.what());
    } catch (const std::bad_alloc &) {
        reply_failure(to, TRC_ERROR_OUT_OF_MEMORY, "it takes too much memory");
    } catch (const std::exception &error) {
        reply_failure(to, TRC_ERROR_IMAGE, error.what());
    }
}

#endif
