#include "source_option.h"

#include <string.h>

#include "cli.h"
#include "faults_option.h"
#include "open_bank.h"

void source_request_start(struct source_request *request)
{
    memset(request, 0, sizeof *request);
    request->options.session.faults = (struct bus_faults){.id_to = 0x7FF, .seed = 1, .delay_us = 500};
}

int source_option(struct source_request *request, int answer, const char *argument, struct failure *why)
{
    struct session_options *session = &request->options.session;
    int status = STATUS_OK;
    switch (answer) {
    case SOURCE_BUS:
        request->options.bus = argument;
        break;
    case SOURCE_GESTURE:
        status = cli_each("--gesture", argument, session->gesture, why);
        break;
    case SOURCE_TICKS:
        status = cli_whole("--ticks", argument, 1, 1000000000, &session->ticks, why);
        break;
    case SOURCE_DEVICE:
        status = cli_each("--device", argument, session->device, why);
        break;
    case SOURCE_FAULTS:
        status = faults_option(argument, &session->faults, why);
        break;
    case SOURCE_SEED:
        status = cli_whole("--seed", argument, 0, UINT64_MAX, &session->faults.seed, why);
        break;
    case SOURCE_SECONDS:
        status = cli_whole("--seconds", argument, 1, 1000000000, &request->seconds, why);
        break;
    default:
        return 0;
    }
    return status ? status : 1;
}

bool source_simulated(const struct source_request *request)
{
    return !request->options.bus || !strcmp(request->options.bus, "soft");
}

int source_open(struct source_request *request, struct frame_source **source, struct failure *why)
{
    *source = NULL;
    if (request->path) {
        const int status = open_bank(request->path, NULL, &request->bank, why);
        if (status)
            return status;
        request->bank_open = true;
        request->options.bank = &request->bank;
    }
    return frame_source_open(&request->options, source, why);
}

void source_close(struct source_request *request, struct frame_source *source)
{
    frame_source_close(source);
    if (request->bank_open)
        bank_unload(&request->bank);
    request->bank_open = false;
}
