"""A client without generated code: all that it knows of the API it asks the server for."""
import sys

import grpc
from google.protobuf import descriptor_pool, json_format, message_factory
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

channel = grpc.insecure_channel(sys.argv[1])
database = ProtoReflectionDescriptorDatabase(channel)
pool = descriptor_pool.DescriptorPool(database)


def call(path, request):
    """Calls a method with a request in JSON; gives the answer in JSON, or a list of answers."""
    service, method = path.split("/")
    method = pool.FindServiceByName("guardsplat.v1." + service).FindMethodByName(method)
    kinds = [message_factory.GetMessageClass(kind) for kind in (method.input_type, method.output_type)]
    make = channel.unary_stream if method.server_streaming else channel.unary_unary
    send = make(
        f"/{method.containing_service.full_name}/{method.name}",
        request_serializer=kinds[0].SerializeToString,
        response_deserializer=kinds[1].FromString,
    )
    answer = send(json_format.ParseDict(request, kinds[0]()), timeout=300)
    if method.server_streaming:
        return [json_format.MessageToDict(part) for part in answer]
    return json_format.MessageToDict(answer)


def refused(path, request):
    """The code that a call is refused with."""
    try:
        answer = call(path, request)
    except grpc.RpcError as error:
        # The details travel as google.rpc.Status.
        assert any(key == "grpc-status-details-bin" for key, _ in error.trailing_metadata()), error
        return error.code()
    raise AssertionError(f"{path} was not refused: {answer}")


services = database.get_services()
for name in ("JobService", "ArtifactService", "KeyService"):
    assert "guardsplat.v1." + name in services, services

job = call("JobService/CreateJob", {"job": {"displayName": "from afar", "createKey": {"bits": 8}}})
assert job["state"] == "STATE_QUEUED" and job["name"].startswith("jobs/"), job
watched = call("JobService/WatchJob", {"name": job["name"]})
assert watched[-1]["job"]["state"] == "STATE_SUCCEEDED", watched
key = watched[-1]["job"]["keyResult"]["key"]
assert call("KeyService/GetKey", {"name": key})["bits"] == 8
assert [k["name"] for k in call("KeyService/ListKeys", {})["keys"]] == [key]
assert call("JobService/GetJob", {"name": job["name"]})["state"] == "STATE_SUCCEEDED"
assert [j["name"] for j in call("JobService/ListJobs", {"states": ["STATE_SUCCEEDED"]})["jobs"]] == [job["name"]]
assert "jobs" not in call("JobService/ListJobs", {"states": ["STATE_FAILED"]})

assert refused("JobService/CreateJob", {"job": {"createKey": {"bits": 151}}}) == grpc.StatusCode.INVALID_ARGUMENT
assert refused("JobService/GetJob", {"name": "jobs/../keys"}) == grpc.StatusCode.INVALID_ARGUMENT
assert refused("KeyService/GetKey", {"name": job["name"].replace("jobs", "keys")}) == grpc.StatusCode.NOT_FOUND
assert refused("JobService/CancelJob", {"name": job["name"]}) == grpc.StatusCode.FAILED_PRECONDITION
print("done")
