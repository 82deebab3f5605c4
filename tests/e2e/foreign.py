"""A gRPC client that knows nothing of taxeld but its address: everything comes from the server's own reflection."""

import grpc
from google.protobuf import json_format
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase


class Client:
    def __init__(self, address):
        # Connections of its own: one to a daemon that was killed at this address may seem ready still.
        self.channel = grpc.insecure_channel(address, [("grpc.use_local_subchannel_pool", 1)])
        grpc.channel_ready_future(self.channel).result(timeout=60)
        self.pool = DescriptorPool(ProtoReflectionDescriptorDatabase(self.channel))

    def _method(self, name):
        service, method = name.split("/")
        descriptor = self.pool.FindServiceByName("taxel.v1." + service).FindMethodByName(method)
        request = GetMessageClass(descriptor.input_type)
        answer = GetMessageClass(descriptor.output_type)
        path = f"/taxel.v1.{service}/{method}"
        if descriptor.server_streaming:
            call = self.channel.unary_stream
        else:
            call = self.channel.unary_unary
        return call(path, request.SerializeToString, answer.FromString), request

    def call(self, name, timeout=60, **fields):
        """One answer; raises grpc.RpcError."""
        method, request = self._method(name)
        return method(json_format.ParseDict(fields, request()), timeout=timeout)

    def stream(self, name, timeout=300, **fields):
        """Answers one by one, until the caller stops or the time is over."""
        method, request = self._method(name)
        return method(json_format.ParseDict(fields, request()), timeout=timeout)

    def outcome(self, name, **fields):
        """The status of a call and its details: `OK` and the answer."""
        try:
            return "OK", self.call(name, **fields)
        except grpc.RpcError as error:
            return error.code().name, error.details()

    def refused(self, name, **fields):
        """The status of a call that must fail."""
        code, details = self.outcome(name, **fields)
        assert code != "OK", f"{name} {fields} was not refused: {details}"
        return code, details


def enum_name(message, field):
    """The name of an enum field's value."""
    descriptor = message.DESCRIPTOR.fields_by_name[field]
    return descriptor.enum_type.values_by_number[getattr(message, field)].name
